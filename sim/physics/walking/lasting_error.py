"""Lasting error: where the capture point of a robot that walks is always off, from a slope, a load or a leaning sensor.

An error that changes sides with the feet does not last, however long a slow step is, and a push soon passes. So the
error is first smoothed on each foot, and the mean of the two feet is added up:

    e_i' = s_i / TAKES (e - e_i),      b' = LEARNS (e_1 + e_2) / 2                                               (16)

with the error e, of which no more than BIG counts, and the shares s_i of the feet that stand.
"""

from __future__ import annotations

import numpy as np

from controller.motion.rotations import Array

# How fast a lasting error is learned, 1/s.
LEARNS = 0.5
# The error on a foot is smoothed over so long, s.
TAKES = 0.25
# How much of an error counts at most, and how much is learned at most, in heights of the root.
BIG, LEARNED = 0.03, 0.12


class LastingError:
    """What is learned of the error of the capture point, ahead and left of the heading."""

    def __init__(self, height: float, dt: float) -> None:
        """Takes the height of the robot's root, m, and the time between two ticks, s."""
        self._dt, self._big, self._most = dt, BIG * height, LEARNED * height
        self._feet = np.zeros((2, 2))
        self._learned = np.zeros(2)

    def learn(self, off: Array, standing: Array) -> Array:
        """What is learned by the end of a tick, (2,), m.

        Args:
            off: how far the capture point is off, shape (2,), m.
            standing: which feet stand, shares that sum to 1, shape (2,).
        """
        shares = min(1.0, self._dt / TAKES) * standing
        self._feet += shares[:, None] * (np.clip(off, -self._big, self._big) - self._feet)
        self._learned += LEARNS * self._dt * self._feet.mean(axis=0)
        np.clip(self._learned, -self._most, self._most, out=self._learned)
        return self._learned
