"""The encoding with twists: bone directions, and for each a vector across the bone.

For a skeleton of B bones a frame has 10 + 6 B channels: the 4 + 3 B of `bone_directions`, then

    direction of the root's forward axis            3
    direction of each bone's side                   3 B
    direction of the root's left axis               3

all in the heading frame. A direction and a side determine a rotation (`orientation.py` has to choose the twist), and
unlike angles or quaternions they are continuous: networks may average the channels of two motions.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from controller.motion.encodings.bone_directions import FIRST_BONE, BoneDirections
from controller.motion.rotations import Array, FixedVectors, about, between, cross, dot, multiply, normalise, rotate

FORWARD_AXIS, LEFT_AXIS = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class JointRotations(BoneDirections):
    """Conversion between clips of a skeleton and channels, twists included."""

    name: ClassVar[str] = "joint rotations"
    twist_by_rule: ClassVar[bool] = False

    @property
    def channels(self) -> int:
        """The number of channels of a frame."""
        return FIRST_BONE + 6 * (1 + len(self.skeleton))

    @cached_property
    def _axes(self) -> tuple[Array, Array]:
        """Direction and side of each bone, then of the root, in the rest pose, shape (B + 1, 3) each."""
        direction = np.vstack([self.skeleton.rest_direction, FORWARD_AXIS])
        # Across the bone, and as near as possible to the axis that is farthest from it.
        axis = np.eye(3)[np.abs(direction).argmin(axis=1)]
        side = normalise(axis - dot(axis, direction)[:, None] * direction)
        side[-1] = LEFT_AXIS
        return direction, side

    @cached_property
    def _rest_side(self) -> FixedVectors:
        return FixedVectors(self._axes[1])

    def directions(self, channels: Array) -> Array:
        """Unit vectors of the bones, shape (..., B, 3)."""
        return self._vectors(channels)[0][..., :-1, :]

    def direction_channels(self, rotation: Array) -> Array:
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
