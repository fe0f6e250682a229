"""A phase lock: steers the tempo to keep step with a reference that turns: a beat, another deck, or a person."""

# ruff: noqa: D102 (`references` documents what its sources do)

import math
from dataclasses import dataclass
from typing import Literal, Protocol

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


@dataclass(frozen=True, slots=True)
class Steering:
    """The tempo that a lock asks for, and the phase of a jump if the error is large."""

    tempo: float
    jump: float | None = None


MOST, STIFFNESS = 1.0, 5.0  # corrections of the tempo: at most this much, and 1/s for small errors
_SHARE = 0.8  # of the rate of the tempo, that braking uses; the rest is left for what the reference itself does


def wrapped(phase: float, modulus: float = 1.0) -> float:
    """The same phase in [-modulus / 2, modulus / 2)."""
    return phase - modulus * math.floor(phase / modulus + 0.5)


def correction(error: float, rate: float) -> float:
    """The correction to the tempo of the reference for a phase error, s of the motion; `rate` is the tempo's own, 1/s.

    In proportion to small errors; to larger ones as the speed from which a constant deceleration b just ends at zero,
    joined to the line without a kink: the proximate time-optimal servomechanism (Franklin, Powell and Workman,
    "Digital Control of Dynamic Systems").

        v = k |e|                                 up to b / k^2
        v = sqrt(2 b (|e| - b / (2 k^2)))         beyond, at most MOST
    """
    brake, size = _SHARE * rate, abs(error)
    linear = brake / STIFFNESS**2
    speed = STIFFNESS * size if size <= linear else math.sqrt(2.0 * brake * (size - 0.5 * linear))
    return math.copysign(min(speed, MOST), error)


# A loop is locked after an error below the first for HELD seconds, until it is beyond the second, s.
LOCKED_WITHIN, LOST_BEYOND, HELD = 0.02, 0.05, 0.2
JUMPS_BEYOND = 0.8  # error beyond which a loop jumps instead of changing its tempo, s of the motion
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


class ReferenceSource(Protocol):
    """A source of reference phases."""

    @property
    def name(self) -> Literal["beat", "deck", "person"]: ...
    def reference(self, playhead: LoopPlace) -> Reference | None: ...  # called once a tick; None before there is one
    @property
    def per_minute(self) -> float | None: ...  # beats, if it has any


class PhaseLock:
    """Keeps a motion in step with a reference; without one it is played at the commanded tempo."""

    owns_tempo = True  # it replaces the commanded tempo

    def __init__(self, source: ReferenceSource, rate: float) -> None:
        self.source, self.rate = source, rate
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
            return Steering(playhead.tempo)
        tempo = reference.rate * playhead.seconds
        behind = reference.phase - playhead.phase
        error = (behind if reference.once else wrapped(behind, reference.modulus)) * playhead.seconds
        self._note(playhead.time, error / max(abs(tempo), _SLOWEST) if reference.steady else None)
        if abs(error) > JUMPS_BEYOND and playhead.alone:
            return Steering(_clipped(tempo, tempo), (playhead.phase + error / playhead.seconds) % 1.0)
        steered = tempo + correction(error, self.rate)
        return Steering(_clipped(steered, steered if reference.turns_back else tempo))

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
