"""The encoding that keeps how bones are twisted: bone directions, and beside each a vector that lies across the bone.

For a skeleton of B bones a frame has 10 + 6 B channels: the 4 + 3 B of `bone_directions`, then

    where the root's forward axis points            3
    where each bone's side points                   3 B
    where the root's left axis points               3

all in the heading frame. A direction and a side fix a rotation: nothing is guessed (as `orientation.py` must), and
unlike angles or quaternions they have no seam: networks may average the channels of two motions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from controller.motion.encodings.bone_directions import FIRST_BONE, BoneDirections
from controller.motion.rotations import Array, FixedVectors, about, between, cross, dot, multiply, normalise, rotate

FORWARD_AXIS, LEFT_AXIS = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class JointRotations(BoneDirections):
    """Clips of a skeleton to channels and back, twists included."""

    name: ClassVar[str] = "joint rotations"
    twist_by_rule: ClassVar[bool] = False

    @property
    def channels(self) -> int:
        """How many channels a frame has."""
        return FIRST_BONE + 6 * (1 + len(self.skeleton))

    @cached_property
    def _axes(self) -> tuple[Array, Array]:
        """Direction and side of each bone, then of the root, in the rest pose, shape (B + 1, 3) each."""
        direction = np.vstack([self.skeleton.rest_direction, FORWARD_AXIS])
        # Across the bone and as near as may be to the axis that it is farthest from.
        axis = np.eye(3)[np.abs(direction).argmin(axis=1)]
        side = normalise(axis - dot(axis, direction)[:, None] * direction)
        side[-1] = LEFT_AXIS
        return direction, side

    @cached_property
    def _rest_side(self) -> FixedVectors:
        return FixedVectors(self._axes[1])

    def directions(self, channels: Array) -> Array:
        """Where the bones point, brought back to unit length, shape (..., B, 3)."""
        return self._vectors(channels)[0][..., :-1, :]

    def spell(self, rotation: Array) -> Array:
        """The channels from FIRST_BONE on of rotations (T, 1 + B, 4) in the heading frame, shape (T, C - 4)."""
        turned = np.roll(rotation, -1, axis=1)
        return np.concatenate([rotate(turned, axis).reshape(len(rotation), -1) for axis in self._axes], axis=1)

    def rotations(self, channels: Array) -> Array:
        """The rotations of channels (..., C), in the heading frame, shape (..., 1 + B, 4)."""
        direction, side = self._vectors(channels)
        swing = between(self._axes[0], direction)
        start = self._rest_side.turned(swing)
        twist = np.arctan2(dot(direction, cross(start, side)), dot(start, side))
        return np.roll(multiply(about(direction, twist), swing), 1, axis=-2)

    def _vectors(self, channels: Array) -> tuple[Array, Array]:
        """Unit directions, and sides of any length, of the bones and then the root, shape (..., B + 1, 3) each."""
        vectors = channels[..., FIRST_BONE:].reshape(*channels.shape[:-1], 2, 1 + len(self.skeleton), 3)
        return normalise(vectors[..., 0, :, :]), vectors[..., 1, :, :]
