"""Which deck of a show has to be still and when, from what was done; and whether its recording says so.

A press is known to its member. It reaches every other one that is linked to a carrier (a deck that it has stopped and
that was not reset since, or a conductor that knows it), also over members that it is new to. `REACH` after that, or
`RELINK` after a link was restored, the deck is in the emergency stop, `BRAKE` later its joints are still, and so they
stay until it is reset where it stands. A deck that was stopped and is started again, that starts while it is linked to
a carrier, or that paused without the conductor and is linked again, does not move at all before its reset.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.wire.messages.deck_snapshot import MODES
from controller.wire.run_recording import load_recording

CONDUCTOR, NETWORK = "conductor", "network"
LOSSY = "loss 0.2"
DECKS: tuple[str, ...] = ("a", "b", "c", "d")

REACH = 0.5
"""A press is an emergency stop at every linked deck after this, s."""

REACH_OVER_FEW = 2.5
"""The same where links are missing and many packets are lost, s: TCP sends one again after 0.3, 0.9 and 2.1 s."""

BRAKE = 0.5
"""The joints are still so long after that, s."""

RELINK = 4.0
"""A link that is restored carries messages again after this, s: a dial that has begun while it was cut ends after 2 s,
and the next one comes within a second."""

QUICK = 0.1
"""The moment of a press is known where it took no longer than this, s."""

REMEMBERS = 0.3
"""A deck that has been in the emergency stop for this long, s, is in it when it is killed and started again."""

PAUSES = 1.5
"""A deck has come to rest that has been without the conductor for `lost_after` and this, s."""

TICK = 0.05
"""A tick takes commands that came so long after it began, s."""

SETTLING = 1e-3
"""A paused deck comes to its targets ever more slowly; its joints turn by less than this a tick, rad."""

_STOPPED = MODES.index("emergency stop")


class Event(NamedTuple):
    """Something that was done: between two times, s, and to which member.

    `what` is start, started (it takes part), killed, cut, heal, freeze or thaw (the process that takes part), press,
    reset, over (`go` has ended the stop) or linked (all are); of two members, part or join. Others are not judged.
    """

    began: float
    at: float
    what: str
    name: str


class Must(NamedTuple):
    """A deck has to be in the emergency stop from `begins` to `ends`, and still from `still` on; times in s."""

    name: str
    begins: float
    still: float
    ends: float
    why: str


class Coming(NamedTuple):
    """A stop that a deck can be reached by since a time, NaN if a slow press hides it, and has to be at another, s."""

    since: float
    due: float
    relinked: bool


@dataclass
class _Member:
    """A member as it has to be.

    Attributes:
        since: when it was started, or its link restored; infinite while it starts, s.
        knows, holds: the stops that have reached it, and those that it was not reset since.
        coming: what is to reach it, by stop.
        possible, perhaps: stops that may have reached it, and those that it may have been reset from.
        stopped: since when it has to be in the emergency stop, and still, s; None if it has not.
        awaited: when it was started, s, if it must not move because a stop stands.
        cut_at, frozen: when it was, s; infinite if it is not, or does not pause for it.
        quiet: since when it is linked again after a pause, s.
    """

    alive: bool = False
    linked: bool = True
    since: float = math.inf
    born: float = math.inf
    knows: set[int] = field(default_factory=set)
    holds: set[int] = field(default_factory=set)
    possible: set[int] = field(default_factory=set)
    perhaps: set[int] = field(default_factory=set)
    coming: dict[int, Coming] = field(default_factory=dict)
    stopped: tuple[float, float, str] | None = None
    awaited: float | None = None
    cut_at: float = math.inf
    frozen: float = math.inf
    quiet: float | None = None


class StopModel:
    """What has to be still.

    Args:
        paused_after: how long without the conductor a deck has come to rest, s; infinite if it plays on.
    """

    def __init__(self, paused_after: float) -> None:
        self._paused_after = paused_after
        self._members = {name: _Member() for name in (CONDUCTOR, *DECKS)}
        self._presses: list[float] = []
        self._over: dict[int, float] = {}
        self._parted: set[frozenset[str]] = set()
        self._lossy = False
        self.musts: list[Must] = []
        self.reached: list[tuple[str, Coming]] = []

    def take(self, event: Event) -> None:
        """Takes the next event."""
        self._arrive(event.began)
        if event.name == NETWORK:
            self._lossy = event.what.startswith(LOSSY)
            return
        if event.what in ("part", "join"):
            self._part(event)
            return
        name, member = event.name, self._members[event.name]
        match event.what:
            case "start":
                member.alive = True
                if member.stopped is not None:
                    member.stopped = event.began, event.began, "started again without a reset"
                elif name != CONDUCTOR and self._stands_for(name, event.began):
                    member.awaited = event.began
            case "started":
                member.since = member.born = event.at
                if member.awaited is not None:
                    member.stopped = member.awaited, member.awaited, "started while a stop stood"
                member.awaited = None
            case "killed":
                self._end(name, event.at)
                stopped = member.stopped
                remembers = stopped is not None and stopped[0] < min(event.at, member.frozen) - REMEMBERS
                self._members[name] = _Member(linked=member.linked, stopped=stopped if remembers else None)
                if remembers:
                    self._members[name].knows = {*member.holds}
                    self._members[name].holds = member.holds
            case "cut":
                conducted = all(each.since + RELINK < event.at for each in (member, self._members[CONDUCTOR]))
                conducted &= self._are_linked(name, CONDUCTOR)
                member.linked, member.awaited, member.quiet = False, None, None
                member.cut_at = event.at if conducted else math.inf
            case "heal":
                if event.at - member.cut_at > self._paused_after and member.stopped is None:
                    member.quiet = event.at
                member.linked, member.since = True, max(member.since, event.at) if member.alive else math.inf
            case "freeze":
                member.frozen, member.awaited, member.quiet = event.at, None, None
            case "thaw":
                member.frozen, member.since = math.inf, event.at
            case "press":
                self._presses.append(event.began)
                member.knows.add(len(self._presses))
                member.holds.add(len(self._presses))
                if name != CONDUCTOR:
                    self._stop(member, event.at, "pressed there")
            case "reset":
                self._end(name, event.began)
                member.stopped = member.quiet = None
                member.cut_at = math.inf
                member.perhaps |= member.possible
                member.coming.clear()
                member.holds.clear()
            case "over":
                self._over = dict.fromkeys(member.knows | {*member.coming}, event.began) | self._over
            case "linked":
                for each in self._members.values():
                    each.since = -math.inf
            case _:
                raise ValueError(event.what)
        self._spread(event.began, event.at)

    def finish(self, at: float) -> list[Must]:
        """All that had to be still until a time."""
        self._arrive(at)
        for name in DECKS:
            self._end(name, at)
        return self.musts

    def owed(self) -> set[str]:
        """The decks that have to be in the emergency stop, now or soon."""
        decks = {name: self._members[name] for name in DECKS}
        return {name for name, deck in decks.items() if deck.alive and (deck.stopped or deck.coming)}

    def _part(self, event: Event) -> None:
        """Two members have no link between them, or have it again."""
        one, other = event.name.split()
        if event.what == "part":
            self._parted.add(frozenset({one, other}))
        else:
            self._parted.discard(frozenset({one, other}))
            for member in (self._members[one], self._members[other]):
                member.since = max(member.since, event.at) if member.alive else math.inf
        self._spread(event.began, event.at)

    def _are_linked(self, one: str, other: str) -> bool:
        members = self._members[one], self._members[other]
        linked = all(member.alive and member.linked and member.frozen == math.inf for member in members)
        return linked and frozenset({one, other}) not in self._parted

    @property
    def _links_are_missing(self) -> bool:
        members = self._members.values()
        return bool(self._parted) or any(not each.linked or each.frozen < math.inf for each in members)

    def _carriers(self, stop: int, name: str) -> dict[str, float]:
        """The members that repeat a stop for a deck, and since when each is linked, s."""
        if stop in self._over and self._members[name].born > self._over[stop]:
            return {}
        return {
            carrier: member.since
            for carrier, member in self._members.items()
            if member.alive and stop in (member.knows if carrier == CONDUCTOR else member.holds)
        }

    def _way(self, stop: int, name: str) -> float | None:
        """Since when a stop can come to a member, over others that it is new to, s; None if it cannot."""
        ways = self._carriers(stop, name)
        grown = True
        while grown:
            grown = False
            for there, since in [*ways.items()]:
                for here, member in self._members.items():
                    passes = here == name or not (stop in member.knows or stop in member.perhaps or stop in self._over)
                    if passes and self._are_linked(there, here):
                        found = max(since, member.since)
                        if found < ways.get(here, math.inf) or here not in ways:
                            ways[here], grown = found, True
        return ways.get(name)

    def _stands_for(self, name: str, started: float) -> bool:
        """Whether a deck is stopped before it moves that was started at a time."""
        stops = [stop for stop in range(1, len(self._presses) + 1) if stop not in self._over]
        carriers = [carrier for stop in stops for carrier in self._carriers(stop, name).items()]
        return any(since + RELINK < started and self._are_linked(name, carrier) for carrier, since in carriers)

    def _spread(self, began: float, now: float) -> None:
        """Notes which stops can reach which members, and can no longer."""
        for name, member in self._members.items():
            if member.awaited is not None and not self._stands_for(name, member.awaited):
                member.awaited = None
            for stop in range(1, len(self._presses) + 1):
                if stop in member.knows or stop in member.perhaps:
                    continue
                linked = self._way(stop, name)
                if linked is None or (name == CONDUCTOR and stop in self._over):
                    member.coming.pop(stop, None)
                    continue
                member.possible.add(stop)
                reach = REACH_OVER_FEW if self._lossy and self._links_are_missing else REACH
                reached = Coming(began if now - began < QUICK else math.nan, now + reach, relinked=False)
                if linked + RELINK > now + reach:
                    reached = Coming(linked, linked + RELINK, relinked=True)
                member.coming[stop] = min(member.coming.get(stop, reached), reached, key=lambda each: each.due)
            if not member.coming:
                member.quiet = None

    def _arrive(self, now: float) -> None:
        """Has stops reach those where they are due."""
        coming = [
            (reached.due, name, stop) for name in self._members for stop, reached in self._members[name].coming.items()
        ]
        for due, name, stop in sorted(coming):
            if due > now:
                break
            member = self._members[name]
            reached = member.coming[stop]
            del member.coming[stop]
            member.knows.add(stop)
            member.holds.add(stop)
            if name == CONDUCTOR:
                continue
            if member.quiet is not None:
                self.musts.append(
                    Must(name, math.inf, member.quiet, due, "paused, and linked again while a stop stood")
                )
                member.quiet = None
            if member.stopped is None:
                self.reached.append((name, reached))
            self._stop(member, due, f"press {stop}")
            self._spread(due, due)

    @staticmethod
    def _stop(deck: _Member, at: float, why: str) -> None:
        if deck.stopped is None:
            deck.stopped = at, at + BRAKE, why

    def _end(self, name: str, at: float) -> None:
        deck = self._members[name]
        if deck.alive and deck.stopped is not None and deck.stopped[0] < at:
            begins, still, why = deck.stopped
            self.musts.append(Must(name, begins, still, at, why))


class DeckTicks(NamedTuple):
    """What recordings of a deck say, tick by tick: when it began, s, whether stopped, how far a joint turned, rad."""

    times: NDArray[np.float64]
    stopped: NDArray[np.bool_]
    turned: NDArray[np.float64]

    @classmethod
    def read(cls, files: Iterable[Path]) -> DeckTicks:
        """Reads the recordings of a deck, one for each time it was started."""
        parts: list[tuple[NDArray[np.float64], ...]] = [(np.empty(0), np.empty(0), np.empty(0))]
        for file in files:
            if not file.exists() or not file.stat().st_size:
                continue  # it was killed before its first ticks were written
            fields = load_recording(file).fields
            turned = np.abs(np.diff(fields["targets"], axis=0, prepend=fields["targets"][:1])).max(axis=1)
            parts.append((fields["clock_s"][:, 0], fields["mode"][:, 0], turned))
        times, mode, turned = (np.concatenate(part) for part in zip(*parts, strict=True))
        return cls(times, mode == _STOPPED, turned)


def violations(musts: Iterable[Must], ticks: dict[str, DeckTicks]) -> Iterator[tuple[Must, str]]:
    """What was to be still and was not: which, and what it did."""
    for must in musts:
        deck, ends = ticks[must.name], must.ends - TICK
        playing = deck.times[(deck.times > must.begins) & (deck.times < ends) & ~deck.stopped]
        if len(playing):
            yield must, f"not stopped in {len(playing)} ticks, {playing[0] - must.begins:.2f} s later"
        least = SETTLING if must.begins == math.inf else 0.0
        moving = deck.times[(deck.times > must.still) & (deck.times < ends) & (deck.turned > least)]
        if len(moving):
            yield must, f"moved in {len(moving)} ticks, {moving[0] - must.still:.2f} s later"


def delays(
    reached: Iterable[tuple[str, Coming]], ticks: dict[str, DeckTicks], *, relinked: bool
) -> NDArray[np.float64]:
    """How long stops took to decks that played when they could be reached, s."""
    found: list[float] = []
    for name, stop in reached:
        deck = ticks[name]
        after = deck.times > stop.since
        if stop.relinked == relinked and after.any() and not deck.stopped[after][0]:
            stopped = deck.times[after & deck.stopped]
            if len(stopped) and stopped[0] < stop.due:  # else it is counted among what was wrong
                found.append(stopped[0] - stop.since)
    return np.array(found)
