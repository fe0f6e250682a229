"""The root's path: where a body seen from its own heading stands in the world, summed up from its velocities."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from controller.mocap.posture import Pose, Posture
from controller.rotations import multiply, yaw


class RootPath:
    """The position and heading of the root in the world; it begins at the origin and faces along x."""

    def __init__(self) -> None:
        self._x = self._y = 0.0
        self._heading = 0.0

    def advance(self, posture: Posture, dt: float) -> Pose:
        """The pose of a posture in the world after moving with its velocities (x forward, y left) for dt seconds."""
        self._heading += float(posture.turn_rate) * dt
        cosine, sine = cos(self._heading), sin(self._heading)
        forward, left = (posture.velocity * dt).tolist()
        self._x += cosine * forward - sine * left
        self._y += sine * forward + cosine * left
        position = np.array([self._x, self._y, float(posture.height)])
        return Pose(position, np.array(self._heading), multiply(yaw(self._heading), posture.rotation))
