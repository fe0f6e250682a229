"""The state of a show, as its page shows it: cues and decks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from motiondeck.shows.messages import DeckHealth, StopAt
from motiondeck.shows.show_file import ShowCue

if TYPE_CHECKING:
    from motiondeck.shows.conductor import Conductor
    from motiondeck.shows.seen_decks import SeenDeck


class DeckRow(msgspec.Struct, frozen=True):
    """A deck."""

    name: str
    robot: str  # this and the next two are "" until it has said what it is
    library: str
    host: str
    here: bool
    losses: int
    heard_ago: float  # how long ago it has said how it is, s
    health: DeckHealth | None  # what it said; None without a connection, and before that
    stop: StopAt = ""


class ShowState(msgspec.Struct, frozen=True, tag="state"):
    """A show at a moment."""

    show: str
    cues: list[ShowCue]
    present: int | None = None  # the number, from 0, of the cue that was last carried out; None before the first
    upcoming: int | None = None  # of the one that comes next; None after the last
    seconds: float | None = None  # how long until then; None if unknown
    waits: bool = False  # whether only `go` brings it
    stopped_by: str = ""  # the member that gave the emergency stop, or ""
    decks: list[DeckRow] = []


class ShowNotice(msgspec.Struct, frozen=True, tag="notice"):
    """The outcome of a button."""

    text: str


def show_state(conductor: Conductor) -> ShowState:
    """The present state of a show."""
    now, cues = conductor.now(), conductor.cues
    present = max((number for number, at in conductor.given.items() if at <= now), default=None)
    # A cue is sent ahead of its time; until then it is still to come.
    sent = min((number for number, at in conductor.given.items() if at > now), default=None)
    upcoming = sent if sent is not None else cues.number if cues.next is not None else None
    at = conductor.given[sent] if sent is not None else cues.next_at
    return ShowState(
        show=conductor.show.show,
        cues=conductor.show.cues,
        present=present,
        upcoming=upcoming,
        seconds=max(at - now, 0.0) if at is not None else None,
        waits=sent is None and cues.waits,
        stopped_by=conductor.stopped_by,
        decks=[_row(deck, now, conductor.stop_at(deck)) for _, deck in sorted(conductor.decks.items())],
    )


def _row(deck: SeenDeck, now: float, stop: StopAt) -> DeckRow:
    about, health = deck.about, deck.health
    robot, library, host = (about.robot, about.library, about.host) if about is not None else ("", "", "")
    return DeckRow(deck.name, robot, library, host, deck.here, deck.losses, now - deck.heard, health, stop)
