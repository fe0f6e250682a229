"""Approach: a slow move from rest to rest, to the first pose, to the rest pose and home.

All joints move along the quintic  s = 10 x^3 - 15 x^4 + 6 x^5,  x = t / T, which starts and ends without velocity and
acceleration. Over a distance d its greatest velocity is 15/8 d/T, acceleration 10/sqrt(3) d/T^2 and jerk 60 d/T^3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.deck.interfaces import JointLimits
from controller.motion.rotations import Array

_VELOCITY, _ACCELERATION, _JERK = 15.0 / 8.0, 10.0 / np.sqrt(3.0), 60.0


@dataclass(frozen=True)
class Approach:
    """A move of J joints from rest to rest; all arrive together."""

    start: Array  # joint positions, shape (J,), rad
    goal: Array  # joint positions, shape (J,), rad
    duration: float  # s; zero where start and goal are the same but for rounding

    @classmethod
    def within(cls, limits: JointLimits, start: Array, goal: Array, slowness: float = 4.0) -> Approach:
        """The approach that takes `slowness` times as long as the limits of velocity, acceleration and jerk demand."""
        distance = np.maximum(np.abs(goal - start) - 1e-6, 0.0)  # so far apart is at the same place
        least = [_VELOCITY * distance / limits.velocity, np.sqrt(_ACCELERATION * distance / limits.acceleration)]
        shortest = np.max([*least, np.cbrt(_JERK * distance / limits.jerk)], initial=0.0)
        return cls(start.copy(), goal.copy(), slowness * float(shortest))

    def at(self, time: float) -> Array:
        """Joint positions (J,), rad, `time` seconds after the start; before it the start, after the end the goal."""
        x = min(max(time / self.duration, 0.0), 1.0) if self.duration > 0.0 else 1.0
        return self.start + (self.goal - self.start) * (x**3 * (10.0 - 15.0 * x + 6.0 * x * x))
