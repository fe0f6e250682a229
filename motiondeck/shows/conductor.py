"""The conductor of a show: finds decks, tells them its time, and sends cues ahead of their times."""

import math
import os
import time
from collections.abc import Callable
from itertools import product

from controller.wire.messages.commands import DeckCommand
from motiondeck.shows import messages
from motiondeck.shows.cue_list import CueList
from motiondeck.shows.known_stops import KnownStops
from motiondeck.shows.link import Link, StopRepeater
from motiondeck.shows.membership import CONDUCTOR
from motiondeck.shows.messages import CommonRound
from motiondeck.shows.seen_decks import SeenDeck, SeenDecks
from motiondeck.shows.show_file import Show, ShowCue, show_command
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.mailbox import Mailbox

# Cues fall on multiples of this, s: then they fall on ticks of decks at 50, 100, 200, 250, 500 and 1000 Hz, which the
# show's clock keeps aligned, and all decks carry them out in the same one.
GRID = 0.02
JOINS_EVERY = 1.0  # the period at which a deck that has missed a cue is sent the sum of all cues, s
REPORTED_AFTER = 3.0  # a cue that waits longer for decks reports what it waits for, s
STOP_REPORTED_AFTER = 0.4  # s; an emergency stop that has not reached every deck by then is reported
_NO_CUES = "all cues have been given: type commands to go on"

Notify = Callable[[str], None]


class Conductor:
    """Conducts a show, from its first cue on or one with a number, from 0."""

    def __init__(
        self, show: Show, link: Link, notify: Notify, first: int = 0, now: Callable[[], float] = time.monotonic
    ) -> None:
        self.show, self.now = show, now
        self._link, self._notify = link, notify
        self._run = os.urandom(6).hex()
        self._arrived = Mailbox[tuple[str, bytes]]()
        self.cues = CueList(show.cues, show.lead, now(), first)
        self._number = 0
        self._stops = KnownStops()
        self._stop_repeater = StopRepeater(link)
        self._reported_waiting: ShowCue | None = None
        self._lacks: list[str] = []
        self._reported_lacks: list[str] = []
        self._lacking_since = 0.0
        self._stopped_at, self._reported_stop = 0.0, ""
        self._seen = SeenDecks(show, self._run, notify, now)
        self.decks = self._seen.by_name
        self.given: dict[int, float] = {}  # the time of each cue that was sent, s, by its number from 0
        lost = show.if_lost, show.lost_after
        link.answer("clock", lambda: messages.encode(messages.Time(self._run, now(), *lost, self._stops.latest)))
        link.subscribe("health/*", self._receive)
        link.subscribe("stop", self._receive)
        link.watch("deck/*", lambda key, here: self._arrived.put((f"here/{key}", b"1" if here else b"")))
        link.announce(CONDUCTOR)

    def fileno(self) -> int:
        """Readable when there is something to do, for `select`."""
        return self._arrived.fileno()

    @property
    def stopped_by(self) -> str:
        """The member that gave the emergency stop that stands, or ""."""
        standing = self._stops.standing
        return standing[-1].by or "a deck without a name" if standing else ""

    @property
    def over(self) -> bool:
        """Whether all cues were sent."""
        return self.cues.next is None

    def step(self) -> float:
        """Handles messages and due cues; the time until the next call at the latest, s."""
        for key, data in self._arrived.take():
            self._take(key, data)
        now = self.now()
        self._stop_repeater.step(now)
        if not self.stopped_by:
            self._bring_in(now)  # first: a deck that carries out a later cue counts as having had all before
            while (
                due := self.cues.due(now, lambda when, cue: not self._seen.lacking(when, cue.receivers))
            ) is not None:
                number, cue, at = due
                at, name, present = _on_grid(at), self.cue_name(number), self._seen.present_names
                self.given[number] = at
                decks = self.show.members(cue.receivers, present)
                self._send(name, at, cue.receivers, decks, cue.commands, self._step_of(cue, decks, at))
                self._notify(f"{name}: {_receivers(decks, present)}")
        self._report_stop(now)
        self._report_waiting(now)
        return 0.01

    def close(self) -> None:
        """Ends the show; decks then react as the show file demands."""
        self._link.close()
        self._arrived.close()

    # The user's commands.

    def go(self) -> str:
        """Passes a hold point, or goes on after an emergency stop; the outcome in words."""
        if self.stopped_by:
            still = [deck.name for deck in self._seen.present if self.stop_at(deck) != "reset"]
            if still:
                return f"first reset the emergency stop at: {', '.join(still)}"
            self._stops.end()
            self._seen.forget_sent()
            self.cues.hold()
            then = "go again for the next cue" if not self.over else f"{_NO_CUES}, but for example: all resume"
            return f"the emergency stop is over; {then}"
        if self.over:
            return _NO_CUES
        if self.cues.go(self.now()):
            return "goes on"
        return f"the show does not wait for go; to give {self._next_name} at once: hold, then go"

    def hold(self) -> str:
        """Sends no more cues until `go`; the outcome in words."""
        if self.over:
            return _NO_CUES
        if not self.cues.waits:
            self.cues.hold()
            self._reported_waiting = self.cues.next
        return f"waits for go: {self._next_name}"

    def command(self, names: list[str], line: str) -> str:
        """Has decks and groups carry out a command together, also later ones; what was done, else MotiondeckError."""
        decks = self._seen.named(names)
        if self.stopped_by:
            raise MotiondeckError("the emergency stop is on; reset it at each deck, then: go")
        command = show_command(line)
        for deck, motion in product(decks, command.motions):
            about = self._seen[deck].about
            if about is not None:
                UnknownNameError.check("motion", motion, about.rounds, f"{deck}: ")
        self._send(line, _on_grid(self.now() + self.show.lead), names, decks, [command], None)
        return f"{_receivers(decks, self._seen.present_names)}: {line}"

    def stop(self) -> None:
        """Stops all decks at once."""
        stop = messages.EmergencyStopAll(CONDUCTOR, os.urandom(8).hex())
        self._stop_repeater.start(stop, self.now())
        self._note_stop(stop)

    # Messages of decks.

    def _receive(self, key: str, data: bytes) -> None:
        self._arrived.put((key, data))

    def _take(self, key: str, data: bytes) -> None:
        kind, _, name = key.partition("/")
        if kind == "here":
            name = name.removeprefix("deck/")
            self._seen.see(name, here=bool(data))
            if data:
                self._link.ask(f"deck/{name}", self._receive)
        elif kind == "deck" and (about := messages.read(data, messages.About)) is not None:
            self._seen.introduce(name, about)
        elif kind == "health" and (health := messages.read(data, messages.DeckHealth)) is not None:
            self._seen.note_health(name, health)
            for stop in health.stops:  # some may have been given while another conductor ran, or none
                self._note_stop(stop)
        elif kind == "stop" and (stop := messages.read(data, messages.EmergencyStopAll)) and self._note_stop(stop):
            self._link.publish("stop", data)

    def stop_at(self, deck: SeenDeck) -> messages.StopAt:
        """How far a deck is with the emergency stop that stands; a deck that has not said so is not reset."""
        standing = self._stops.standing
        if not standing:
            return ""
        health = deck.health
        if health is None or not {stop.id for stop in standing} <= {stop.id for stop in health.stops}:
            return "not reached"
        return "holds" if health.mode == "emergency stop" else "reset"

    def _note_stop(self, stop: messages.EmergencyStopAll) -> bool:
        """Notes a stop, or that it is over; whether it is new."""
        new = self._stops.add(stop)
        if new and not stop.over:
            self._stopped_at, self._reported_stop = self.now(), ""
            source = "the conductor" if stop.by == CONDUCTOR else self.stopped_by
            self._notify(f"emergency stop by {source}; reset each deck where it is, then: go")
        return new

    def _report_stop(self, now: float) -> None:
        """Reports which decks the emergency stop has reached, and again when that has changed."""
        if not self.stopped_by:
            return
        names, here = sorted({*self.decks, *self.show.decks}), self._seen.present_names
        lacking = [name for name in names if name not in here or self.stop_at(self.decks[name]) == "not reached"]
        listed = ", ".join(name if name in here else f"{name} (not here)" for name in lacking or names)
        report = f"the emergency stop has {'not ' if lacking else ''}reached {listed}"
        if report != self._reported_stop and names and (not lacking or now > self._stopped_at + STOP_REPORTED_AFTER):
            self._reported_stop = report
            self._notify(report)

    # Cues.

    def _step_of(self, cue: ShowCue, decks: list[str], at: float) -> CommonRound | None:
        if cue.in_step is False:
            return None
        if cue.in_step is not True:
            return CommonRound(at, cue.in_step)
        # The first motion of which a deck knows how long a round takes.
        for motion, deck in product(cue.motions, decks):
            about = self._seen[deck].about
            if about is not None and (seconds := about.rounds.get(motion, 0.0)) > 0.0:
                return CommonRound(at, seconds)
        self._notify(f"{cue.name or 'the cue'}: no deck knows how long a round takes, so none are in step")
        return None

    def _send(
        self, name: str, at: float, to: list[str], decks: list[str], say: list[DeckCommand], step: CommonRound | None
    ) -> None:
        self._number += 1
        cue = messages.TimedCue(self._run, self._number, name, at, decks, say, step)
        self._seen.note_sent(cue, to)
        self._link.publish("cue", messages.encode(cue))

    def _bring_in(self, now: float) -> None:
        """Sends decks that have missed cues, or are new, the sum of all cues."""
        for deck in self._seen.present:
            health, cues = deck.health, deck.cues
            if health is None or health.clock is None or health.mode == "emergency stop" or not cues.number:
                continue
            done = health.cue if health.run == self._run else 0
            since = now - max(cues.at, deck.joined)
            if done < cues.number and since > JOINS_EVERY and deck.heard > cues.at:
                deck.joined = _on_grid(now + self.show.lead)
                self._link.publish("cue", messages.encode(cues.cue(self._run, deck.name, deck.joined)))
                self._notify(f"{deck.name} joins")

    def _report_waiting(self, now: float) -> None:
        """Reports that the next cue waits for `go`, or for what when it takes long, and again when that has changed."""
        cue = self.cues.next
        waiting = cue if self.cues.waits else None
        if waiting is not self._reported_waiting:
            self._reported_waiting = waiting
            if waiting is not None:
                self._notify(f"waits for go: {self._next_name}")
        if cue is None or cue.when is None or self.cues.waits or self.stopped_by:
            return
        lacking = self._seen.lacking(cue.when, cue.receivers)
        if lacking != self._lacks:
            self._lacks, self._lacking_since = lacking, now
        elif lacking and lacking != self._reported_lacks and now - self._lacking_since > REPORTED_AFTER:
            self._reported_lacks = lacking
            self._notify(f"{self._next_name} waits: {', '.join(lacking)}")

    @property
    def _next_name(self) -> str:
        return self.cue_name(self.cues.number)

    def cue_name(self, number: int) -> str:
        """The name of a cue by its number from 0."""
        return self.show.cues[number].name or f"cue {number + 1}"


def _receivers(decks: list[str], present: list[str]) -> str:
    here = ", ".join(deck for deck in decks if deck in present) or "no deck is here"
    absent = [deck for deck in decks if deck not in present]
    return here + (f" (not here: {', '.join(absent)})" if absent else "")


def _on_grid(at: float) -> float:
    return math.ceil(at / GRID) * GRID
