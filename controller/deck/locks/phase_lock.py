"""A phase lock: steers the tempo to keep step with a reference that turns: a beat, another deck, or a person."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from controller.deck.locks.beat_clock import BeatClock
from controller.motion.clip import nearest
from controller.wire.leader_link import Sighting
from controller.wire.messages.arguments import TEMPO
from controller.wire.messages.deck_snapshot import LockState


@dataclass(frozen=True, slots=True)
class LoopPlace:
    """The place of a deck in its motion."""

    time: float  # when it was there, by the clock on which ticks are due (the deck's own time without one), s
    motion: str
    phase: float  # of the motion, [0, 1) in a loop
    seconds: float  # duration of a round or of the one-shot at tempo 1, s
    loop: bool
    tempo: float  # as commanded
    alone: bool  # whether the motion is played alone: nothing is joined, blended or paused


Steering = tuple[float, float | None]  # the tempo that a lock asks for, and the phase of a jump if the error is large
MOST, LINEAR = 1.0, 0.08  # corrections of the tempo: at most this much; in proportion to errors up to this, s
_SHARE = 0.8  # of the rate of the tempo, that braking uses; the rest is left for what the reference itself does


def wrapped(phase: float, modulus: float = 1.0) -> float:
    """The same phase within half a modulus; one that lies so far off is behind."""
    return phase - modulus * nearest(phase / modulus)


def correction(error: float, rate: float) -> float:
    """The correction to the tempo of the reference for a phase error, s of the motion; `rate` is the tempo's own, 1/s.

    In proportion to small errors; to larger ones as the speed from which a constant deceleration b just ends at zero,
    joined to the line without a kink: the proximate time-optimal servomechanism (Franklin, Powell and Workman,
    "Digital Control of Dynamic Systems").

        v = k |e|                                 up to b / k^2 = LINEAR
        v = sqrt(2 b (|e| - b / (2 k^2)))         beyond, at most MOST
    """
    brake, size = _SHARE * rate, abs(error)
    speed = math.sqrt(brake / LINEAR) * size if size <= LINEAR else math.sqrt(2.0 * brake * (size - 0.5 * LINEAR))
    return math.copysign(min(speed, MOST), error)


# A loop is locked after an error below the first for HELD seconds, until it is beyond the second, s.
LOCKED_WITHIN, LOST_BEYOND, HELD = 0.02, 0.05, 0.2
_SLOWEST = 0.1  # a reference below this tempo stands: then errors are seconds of the motion


@dataclass(frozen=True, slots=True)
class Reference:
    """The phase that a loop should have."""

    phase: float  # now
    rate: float  # rounds per second; negative backwards
    modulus: float = 1.0  # phases that differ by this are the same; less than a round where it has several beats
    steady: bool = True  # whether it is known well enough for a lock
    once: bool = False  # whether it is a phase of a one-shot, which does not go round
    turns_back: bool = False  # whether the motion may turn round to reach it, rather than wait


STEADY_BEATS = 4  # beats after which the period counts as known
SILENT_AFTER = 4.0  # periods without a beat after which it counts as silent; the motion keeps its tempo
_RANGE = 0.75  # the steps of a round change where the tempo would be further than this from 1, in octaves


class Beats:
    """Beats, and the phase of a loop that falls on them, in [0, 1].

    A round has `steps` beats, evenly spread; 0 takes 1, 2, 4, 8 or 16, whichever tempo is nearest to 1.
    """

    name: Literal["beat"] = "beat"
    hurry, jumps_beyond = 1.0, 0.8

    def __init__(self, phase: float = 0.0, steps: int = 0) -> None:
        self.clock = BeatClock()
        self._phase, self._steps = phase, steps
        self._chosen = 0

    @property
    def per_minute(self) -> float | None:
        """Beats a minute."""
        return 60.0 / self.clock.period if self.clock.period is not None else None

    def reference(self, playhead: LoopPlace) -> Reference | None:
        """The phase that the beat asks of a loop; without beats it goes on with the period that it had."""
        clock = self.clock
        if clock.period is None or not playhead.loop:
            return None
        steps = self._steps or self._choose(playhead.seconds / clock.period)
        beats = (playhead.time - clock.last) / clock.period
        steady = clock.counted >= STEADY_BEATS and beats < SILENT_AFTER
        return Reference(self._phase + beats / steps, 1.0 / (steps * clock.period), 1.0 / steps, steady)

    def _choose(self, beats: float) -> int:
        """The steps of a round that takes this number of beats at tempo 1."""
        if not self._chosen or abs(math.log2(beats / self._chosen)) > _RANGE:
            self._chosen = 2 ** min(max(round(math.log2(beats)), 0), 4)
        return self._chosen


# What has been seen of another deck since the last call, at a time of this deck's clock, s.
Leader = Callable[[float], Sighting | None]
GAIN = 0.3  # of the error of the predicted phase each sighting corrects: its time is known to a tick or two
FORGOTTEN_AFTER = 1.0  # without sightings for so long the other deck is lost, and the motion keeps its tempo, s


class OtherDeck:
    """A loop of another deck, to be ahead of by a part of a round, in [0, 1].

    Between sightings the phase goes on at the last rate. A motion of another length gets the same rounds a second.
    """

    name: Literal["deck"] = "deck"
    hurry, jumps_beyond, per_minute = 1.0, 0.8, None

    def __init__(self, leader: Leader, ahead: float = 0.0) -> None:
        self._leader, self._ahead = leader, ahead
        self._seen: Sighting | None = None

    def reference(self, playhead: LoopPlace) -> Reference | None:
        """The other deck's phase now, and how fast it turns."""
        new = self._leader(playhead.time)
        if new is not None:
            self._seen = self._corrected(new)
        seen = self._seen
        if seen is None:
            return None
        since = playhead.time - seen.time
        return Reference(seen.phase + self._ahead + seen.rate * since, seen.rate, steady=since < FORGOTTEN_AFTER)

    def _corrected(self, new: Sighting) -> Sighting:
        old = self._seen
        if old is None or new.time - old.time > FORGOTTEN_AFTER:
            return new
        expected = old.phase + 0.5 * (old.rate + new.rate) * (new.time - old.time)
        error = wrapped(new.phase - expected)
        # One that has jumped is not averaged.
        return new if abs(error) > 0.1 else Sighting(new.time, expected + GAIN * error, new.rate)


LET_GO_AFTER = 0.5  # without a sighting for so long the motion plays on at the commanded tempo, s
_LAST = 1.0 - 1e-6  # a phase of 1 would be that of the beginning


class Person:
    """A person that leads, seen now and then in a motion."""

    name: Literal["person"] = "person"
    # People stop within 50 ms, and half a round away is too far to catch up.
    hurry, jumps_beyond, per_minute = 8.0, 0.4, None

    def __init__(self) -> None:
        self._motion, self._phase, self._tempo, self._time = "", 0.0, 1.0, -math.inf
        self._body: Sequence[float] = ()

    def see(self, time: float, motion: str, phase: float, tempo: float, body: Sequence[float] = ()) -> None:
        """Takes the place in a motion, the tempo, and perhaps the body, at a time of this deck's clock, s."""
        self._motion, self._phase, self._tempo, self._time, self._body = motion, phase, tempo, time, body

    def body(self, time: float) -> Sequence[float]:
        """The person's body, or nothing while they were not seen for LET_GO_AFTER."""
        return self._body if time - self._time <= LET_GO_AFTER else ()

    def reference(self, playhead: LoopPlace) -> Reference | None:
        """The person's phase now; None while they do something else, or were not seen for LET_GO_AFTER."""
        since = playhead.time - self._time
        if playhead.motion != self._motion or since > LET_GO_AFTER:
            return None
        rate = self._tempo / playhead.seconds
        phase = self._phase + rate * since
        phase = phase if playhead.loop else min(max(phase, 0.0), _LAST)
        return Reference(phase, rate, once=not playhead.loop, turns_back=True)


class PhaseLock:
    """Keeps a motion in step with a reference; without one it is played at the commanded tempo.

    The tempo changes at a rate, 1/s, by a source `hurry` times as fast; off by `jumps_beyond` s a motion jumps.
    """

    def __init__(self, source: Beats | OtherDeck | Person, rate: float) -> None:
        self.source, self.rate, self._unhurried = source, rate, rate
        self._error_s: float | None = None
        self._locked = False
        self._within_since: float | None = None

    @property
    def state(self) -> LockState:
        """Whether it is locked, by how much the motion is behind (ms), and how many beats a minute there are."""
        error_ms = 1e3 * self._error_s if self._error_s is not None else None
        return LockState(self.source.name, "locked" if self._locked else "searching", error_ms, self.source.per_minute)

    def steer(self, playhead: LoopPlace) -> Steering:
        """The reference's own tempo and a correction; far off it asks for a jump, when nothing else is under way."""
        reference = self.source.reference(playhead)
        if reference is None or playhead.loop == reference.once:
            self._note(playhead.time, None)
            self.rate = self._unhurried
            return playhead.tempo, None
        self.rate, tempo = self.source.hurry * self._unhurried, reference.rate * playhead.seconds
        behind = reference.phase - playhead.phase
        error = (behind if reference.once else wrapped(behind, reference.modulus)) * playhead.seconds
        self._note(playhead.time, error / max(abs(tempo), _SLOWEST) if reference.steady else None)
        if abs(error) > self.source.jumps_beyond and playhead.alone:
            return _clipped(tempo, tempo), (playhead.phase + error / playhead.seconds) % 1.0
        steered = tempo + correction(error, self.rate)
        return _clipped(steered, steered if reference.turns_back else tempo), None

    def _note(self, time: float, error: float | None) -> None:
        self._error_s = error
        if error is None or abs(error) > LOST_BEYOND:
            self._locked, self._within_since = False, None
        elif abs(error) > LOCKED_WITHIN:
            self._within_since = None
        elif self._within_since is None:
            self._within_since = time
        elif time - self._within_since >= HELD:
            self._locked = True


def _clipped(tempo: float, reference: float) -> float:
    """A tempo in its range that goes the way of the reference: a motion waits rather than turn round."""
    lowest, highest = (0.0, TEMPO.highest) if reference >= 0.0 else (TEMPO.lowest, 0.0)
    return min(max(tempo, lowest), highest)
