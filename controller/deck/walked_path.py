"""The path: where a body that is seen from its own heading stands in the world, after all that it has walked."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from controller.mocap.posture import Pose, Posture
from controller.rotations import multiply, yaw


class Path:
    """The sum of all steps; it begins at the origin and faces along x."""

    def __init__(self) -> None:
        self._x = self._y = 0.0
        self._heading = 0.0

    def place(self, posture: Posture, dt: float) -> Pose:
        """Where a posture stands after walking on for dt seconds."""
        self._heading += float(posture.turn_rate) * dt
        cosine, sine = cos(self._heading), sin(self._heading)
        forward, left = (posture.velocity * dt).tolist()
        self._x += cosine * forward - sine * left
        self._y += sine * forward + cosine * left
        position = np.array([self._x, self._y, float(posture.height)])
        return Pose(position, np.array(self._heading), multiply(yaw(self._heading), posture.rotation))
