"""The interface of a limiter of joint targets; callers bring one, as `play` its safety envelope."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from controller.deck.interfaces import JointLimits
from controller.motion.rotations import Array


class TargetLimiter(Protocol):
    """Turns the targets of J joints, one call a tick, into targets within their limits."""

    @property
    def changed(self) -> Sequence[int]:
        """The number of targets changed since the start, by joint."""
        ...

    def start(self, position: Array) -> None:
        """Begins anew with the joints at rest at `position`, shape (J,), rad."""
        ...

    def __call__(self, targets: Array) -> Array:
        """Targets within the limits, shape (J,), rad, for any targets (J,); overwritten by the next call."""
        ...


Limiter = Callable[[JointLimits, float], TargetLimiter]
"""Makes a target limiter from joint limits and the tick, s."""
