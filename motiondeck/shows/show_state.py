"""The state of a show, as its page shows it: cues and decks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from motiondeck.shows.messages import DeckHealth, StopAt
from motiondeck.shows.show_file import ShowCue

if TYPE_CHECKING:
    from motiondeck.shows.conductor import Conductor


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
    decks = list[DeckRow]()
    for _, deck in sorted(conductor.decks.items()):
        robot, library, host = (one.robot, one.library, one.host) if (one := deck.about) is not None else ("", "", "")
        heard_ago, stop = now - deck.heard, conductor.stop_at(deck)
        decks.append(DeckRow(deck.name, robot, library, host, deck.here, deck.losses, heard_ago, deck.health, stop))
    return ShowState(
        show=conductor.show.show,
        cues=conductor.show.cues,
        present=present,
        upcoming=upcoming,
        seconds=max(at - now, 0.0) if at is not None else None,
        waits=sent is None and cues.waits,
        stopped_by=conductor.stopped_by,
        decks=decks,
    )
