"""A body at one instant: a posture is relative to the heading; a pose also has a position and heading."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from controller.motion.clip import Clip
from controller.motion.rotations import Array, multiply, yaw
from controller.motion.skeleton import Skeleton


@dataclass(slots=True)
class Posture:
    """Rotations and velocities of a body relative to its heading; leading axes (...) may be time."""

    height: Array  # of the root above the ground, (...), m
    velocity: Array  # of the root along the ground, forward and left, (..., 2), m/s
    turn_rate: Array  # of the heading, about the vertical, (...), rad/s
    rotation: Array  # of the root and of each bone in the heading frame, (..., 1 + B, 4)

    def __getitem__(self, times: slice) -> Posture:
        """A slice of the postures along the first axis, time."""
        return Posture(self.height[times], self.velocity[times], self.turn_rate[times], self.rotation[times])


@dataclass(slots=True)
class Pose:
    """A body in the world; leading axes (...) may be time."""

    root_position: Array  # (..., 3), m, z up
    heading: Array  # about z from x, (...), rad
    rotation: Array  # of the root and of each bone in the world, (..., 1 + B, 4)


def poses_of(clip: Clip) -> Iterator[Pose]:
    """The frames of a clip; the heading is in the rotation of the root."""
    heading = np.zeros(())
    return (Pose(place, heading, turn) for place, turn in zip(clip.root_position, clip.rotation, strict=True))


def walk_path(posture: Posture, dt: float, speed: float = 1.0) -> Pose:
    """The poses of a posture sequence of shape (T, ...) that starts at the origin facing x."""
    # Heading and path integrate the turn rates and velocities in steps of dt seconds, the first frame included, as in
    # Jaeger's patterns.
    heading = np.cumsum(posture.turn_rate * dt * speed)
    step = posture.velocity * dt * speed
    cos, sin = np.cos(heading), np.sin(heading)
    x = np.cumsum(cos * step[:, 0] - sin * step[:, 1])
    y = np.cumsum(sin * step[:, 0] + cos * step[:, 1])
    position = np.stack([x, y, posture.height], axis=-1)
    return Pose(position, heading, multiply(yaw(heading)[:, None, :], posture.rotation))


def walked_clip(name: str, skeleton: Skeleton, posture: Posture, rate: float, source: str = "") -> Clip:
    """The clip of postures at a rate, Hz, that starts at the origin."""
    pose = walk_path(posture, 1.0 / rate)
    return Clip(name, skeleton, rate, pose.root_position, pose.rotation, source)
