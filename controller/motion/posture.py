"""A body at one instant: a posture is relative to the heading; a pose also has a position and heading."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.motion.rotations import Array, multiply, yaw


@dataclass(slots=True)
class Posture:
    """Rotations and velocities of a body relative to its heading; leading axes (...) may be time.

    Attributes:
        height: of the root above the ground, shape (...), m.
        velocity: of the root along the ground, forward and left, shape (..., 2), m/s.
        turn_rate: of the heading, about the vertical, shape (...), rad/s.
        rotation: of the root and of each bone in the heading frame, shape (..., 1 + B, 4).
    """

    height: Array
    velocity: Array
    turn_rate: Array
    rotation: Array

    def __getitem__(self, times: slice) -> Posture:
        """A slice of the postures along the first axis, time."""
        return Posture(self.height[times], self.velocity[times], self.turn_rate[times], self.rotation[times])


@dataclass(slots=True)
class Pose:
    """A body in the world; leading axes (...) may be time.

    Attributes:
        root_position: shape (..., 3), m, z up.
        heading: of the body, about z from x, shape (...), rad.
        rotation: of the root and of each bone in the world, shape (..., 1 + B, 4).
    """

    root_position: Array
    heading: Array
    rotation: Array


def walk_path(posture: Posture, dt: float, speed: float = 1.0) -> Pose:
    """The poses of a posture sequence of shape (T, ...) that starts at the origin facing x.

    Heading and path integrate the turn rates and velocities in steps of dt seconds, the first frame included, as in
    Jaeger's patterns.
    """
    heading = np.cumsum(posture.turn_rate * dt * speed)
    step = posture.velocity * dt * speed
    cos, sin = np.cos(heading), np.sin(heading)
    x = np.cumsum(cos * step[:, 0] - sin * step[:, 1])
    y = np.cumsum(sin * step[:, 0] + cos * step[:, 1])
    position = np.stack([x, y, posture.height], axis=-1)
    return Pose(position, heading, multiply(yaw(heading)[:, None, :], posture.rotation))
