"""Preview: the body follows the motion with a delay, so that its next steps are known before they begin.

This needs no prediction: the future of the body has been played already, whatever motion, tempo and switches.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from controller.motion.rotations import Array
from sim.physics.walking.footfalls import Footfalls

AHEAD = 1.2  # delay of the body behind the motion, s

# Window of the root's mean height before and after, s: at half the tempo the body would else bob with each step.
EVEN = 0.5 * AHEAD
# Time constant of the path, s, against the sway of the body.
SWAY = 0.5


class Travel:
    """Distance of a swaying body along the ground so far, in `metres`."""

    def __init__(self, dt: float) -> None:
        """Args: the tick, s."""
        self.metres = 0.0
        self._share = 1.0 - float(np.exp(-dt / SWAY))
        self._smooth: Array | None = None

    def add(self, place: Array) -> None:
        """Adds the next place, shape (2,), m."""
        if self._smooth is None:
            self._smooth = place.copy()
        step = self._share * (place - self._smooth)
        self._smooth += step
        self.metres += float(np.hypot(*step))


class Preview:
    """The motion from the tick of the body to the latest one.

    Attributes:
        footfalls: the present and coming swings.
        travel: distance of the motion up to the body's tick.
    """

    def __init__(self, height: float, dt: float) -> None:
        """Args: height of the root, m; the tick, s."""
        self._dt, self._newest = dt, AHEAD
        self._ring: deque[tuple[Array, float]] = deque(maxlen=round(AHEAD / dt) + 1)
        self._near = round(EVEN / dt)
        self._heights: deque[float] = deque([height] * (2 * self._near), maxlen=2 * self._near)
        self.footfalls = Footfalls(height, dt)
        self.travel = Travel(dt)

    def add(self, goal: Array, heading: float, soles: Array, yaws: Array, pitches: Array) -> None:
        """Adds the next tick, a posture (nq,) with heading, rad, soles (2, 3), m, their yaws and pitches (2,), rad.

        Before the first one, the motion stood still.
        """
        for _ in range(1 if self._ring else self._ring.maxlen or 1):
            self._ring.append((goal.copy(), heading))
        self._newest += self._dt
        self.footfalls.add(self._newest, soles, yaws, heading, pitches)
        self._heights.append(float(self._ring[self._near][0][2]))
        self.travel.add(self.goal[:2])

    @property
    def goal(self) -> Array:
        """The posture of the body's tick, shape (nq,)."""
        return self._ring[0][0]

    @property
    def heading(self) -> float:
        """Its heading, rad."""
        return self._ring[0][1]

    @property
    def height(self) -> float:
        """Mean height of the root around the body's tick, m."""
        return float(np.mean(self._heights))
