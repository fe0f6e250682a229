"""What a deck asks of a lock, whatever it locks to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from controller.wire.messages.lock_state import LockState


@dataclass(frozen=True, slots=True)
class LoopPlace:
    """Where a deck is.

    Attributes:
        time: when it was there, by the clock on which ticks are due (the deck's own time without one), s.
        motion: what is played.
        phase: how far the motion is, [0, 1) in a loop.
        seconds: how long one round of the loop, or the one-shot, takes at tempo 1, s.
        loop: whether it is a loop.
        tempo: the commanded tempo.
        alone: whether the motion is played alone: nothing is joined, blended or paused.
    """

    time: float
    motion: str
    phase: float
    seconds: float
    loop: bool
    tempo: float
    alone: bool


@dataclass(frozen=True, slots=True)
class Steering:
    """The tempo that a lock wants now, and the phase that it wants to be fetched to by a jump, if it is far off."""

    tempo: float
    jump: float | None = None


class Lock(Protocol):
    """Steers the tempo of a deck.

    Attributes:
        rate: how fast it changes the tempo, 1/s.
        owns_tempo: whether the tempo is no longer that of the commands.
    """

    rate: float
    owns_tempo: bool

    def steer(self, playhead: LoopPlace) -> Steering:
        """What it wants at this tick; called once a tick."""
        ...

    @property
    def state(self) -> LockState:
        """Whether it is locked, and how far off it is."""
        ...
