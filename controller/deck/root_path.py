"""The root's path: where a body seen from its own heading stands in the world, summed up from its velocities."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from controller.motion.posture import Pose, Posture
from controller.motion.rotations import turned_about_vertical


def at_origin(posture: Posture) -> Pose:
    """A posture that stands at the origin and faces along x."""
    return Pose(np.array([0.0, 0.0, float(posture.height)]), np.array(0.0), posture.rotation)


def advance(pose: Pose, posture: Posture, dt: float) -> Pose:
    """The posture in the world, after moving on from a pose with its velocities (x forward, y left) for dt seconds."""
    heading = float(pose.heading) + float(posture.turn_rate) * dt
    cosine, sine = cos(heading), sin(heading)
    forward, left = (posture.velocity * dt).tolist()
    x, y, _ = pose.root_position.tolist()
    position = np.array([x + cosine * forward - sine * left, y + sine * forward + cosine * left, float(posture.height)])
    return Pose(position, np.array(heading), turned_about_vertical(posture.rotation, heading))
