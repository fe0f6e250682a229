"""Preview: the body is a little behind the motion, so that its next steps are known before they begin.

Nothing has to be asked of what makes the motion: the future of the body is what has been played already, whatever the
motion, its tempo and the switches.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from controller.motion.rotations import Array
from sim.physics.walking.footfalls import Footfalls, Swing

AHEAD = 1.2
"""How far the body is behind the motion, s."""

# The body goes up and down with the mean of the motion over so much before and after, s: at half the tempo a stride
# takes twice as long, and the body would bob with each step.
EVEN = 0.5 * AHEAD
# The motion's path is smoothed with this time constant, s: the body sways on its way.
SWAY = 0.5


class Travel:
    """How far a body that sways has gone along the ground.

    Attributes:
        metres: so far.
    """

    def __init__(self, dt: float) -> None:
        """Takes the time between two ticks, s."""
        self.metres = 0.0
        self._share = 1.0 - float(np.exp(-dt / SWAY))
        self._smooth: Array | None = None

    def add(self, place: Array) -> None:
        """Takes the place of the next tick, shape (2,), m."""
        if self._smooth is None:
            self._smooth = place.copy()
        step = self._share * (place - self._smooth)
        self._smooth += step
        self.metres += float(np.hypot(*step))


class Preview:
    """A motion between the tick that is played to the body and the one that has come last.

    Attributes:
        travel: how far the motion has gone by what is played to the body.
    """

    def __init__(self, height: float, dt: float) -> None:
        """Takes the height of the robot's root, m, and the time between two ticks, s."""
        self._dt, self._newest = dt, AHEAD
        self._ring: deque[tuple[Array, float]] = deque(maxlen=round(AHEAD / dt) + 1)
        self._near = round(EVEN / dt)
        self._heights: deque[float] = deque([height] * (2 * self._near), maxlen=2 * self._near)
        self._footfalls = Footfalls(height, dt)
        self.travel = Travel(dt)

    def add(self, goal: Array, heading: float, soles: Array, yaws: Array, pitches: Array) -> None:
        """Takes the next tick; before the first one, the motion stood still.

        Args:
            goal: the posture, shape (nq,).
            heading: rad.
            soles: the middles of the soles in it, shape (2, 3), m.
            yaws: which way they point, shape (2,), rad.
            pitches: how they are turned, toes down, shape (2,), rad.
        """
        for _ in range(1 if self._ring else self._ring.maxlen or 1):
            self._ring.append((goal.copy(), heading))
        self._newest += self._dt
        self._footfalls.add(self._newest, soles, yaws, heading, pitches)
        self._heights.append(float(self._ring[self._near][0][2]))
        self.travel.add(self.goal[:2])

    @property
    def goal(self) -> Array:
        """The posture that is played to the body, shape (nq,)."""
        return self._ring[0][0]

    @property
    def heading(self) -> float:
        """Its heading, rad."""
        return self._ring[0][1]

    @property
    def height(self) -> float:
        """How high the root is in the motion on average around then, m."""
        return float(np.mean(self._heights))

    @property
    def swings(self) -> list[Swing]:
        """The swings that are under way or to come."""
        return self._footfalls.swings

    def forget(self, swing: Swing) -> None:
        """Drops a swing that is over."""
        self._footfalls.forget(swing)
