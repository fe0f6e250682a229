"""The interface of locks to a deck."""

from dataclasses import dataclass
from typing import Protocol

from controller.wire.messages.lock_state import LockState


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


class Lock(Protocol):
    """Steers the tempo of a deck."""

    rate: float  # the rate of change of the tempo, 1/s
    owns_tempo: bool  # whether it replaces the commanded tempo

    def steer(self, playhead: LoopPlace) -> Steering:
        """The steering of this tick; called once a tick."""
        ...

    @property
    def state(self) -> LockState:
        """Whether it is locked, and its error."""
        ...
