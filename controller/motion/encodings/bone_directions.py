"""The encoding of Jaeger's patterns: bone directions in the heading frame (Deliallisi 2017, section 3.1).

For a skeleton of B bones a frame has 4 + 3 B channels:

    0            height of the root above the ground, m
    1            turn rate of the heading, rad/s
    2, 3         velocity of the root along the ground, forward and left, m/s
    4 + 3 b ...  unit vector of bone b: x forward, y left, z up

The heading is the horizontal line from the right hip to the left one, rotated by -90 degrees. If the root lies on that
line, the x components of the two hip bones are zero by construction (channels 5 and 17 of the thesis, counted from 1).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from controller.motion import rotations
from controller.motion.anatomy import Side, anatomy
from controller.motion.clip import Clip
from controller.motion.orientation import orient
from controller.motion.rotations import Array, about, between, conjugate, cross, dot, multiply, normalise, rotate, yaw
from controller.motion.skeleton import ROOT, Posture, Skeleton, SkeletonInfo
from motiondeck_base.errors import FileFormatError

HEIGHT, TURN_RATE, FORWARD, LEFT, FIRST_BONE = 0, 1, 2, 3, 4
FORWARD_AXIS, LEFT_AXIS = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])

# Bones from the root to the hips in Jaeger's patterns and in CMU's recordings.
HIPS = (("rhip", "lhip"), ("rhipjoint", "lhipjoint"))


@dataclass(frozen=True)
class BoneDirections:
    """Conversion between clips of a skeleton and channels."""

    skeleton: Skeleton
    right_hip: str = "rhip"  # the bones from the root to the hips
    left_hip: str = "lhip"

    name: ClassVar[str] = "bone directions"
    twist_by_rule: ClassVar[bool] = True
    """Whether the twist of bones follows a rule (`orientation.py`) and is not in the channels."""

    @classmethod
    def of(cls, skeleton: Skeleton) -> Self:
        """The encoding for a skeleton, by its hips; FileFormatError if no bones lead from its root to two."""
        for right, left in HIPS:
            if right in skeleton.bones and left in skeleton.bones:
                return cls(skeleton, right, left)
        parts = anatomy(skeleton)
        sides: tuple[Side, Side] = ("right", "left")
        hips = [hip for side in sides for hip in parts.all("hip", side)[:1] if skeleton.parent[hip] == ROOT]
        if len(hips) != len(sides):
            raise FileFormatError(
                f"skeleton '{skeleton.name}' has no bones that lead from its root to a right and a left hip, "
                "which tell where it faces"
            )
        return cls(skeleton, *(skeleton.bones[hip] for hip in hips))

    def skeleton_info(self) -> SkeletonInfo:
        """The skeleton as the header of a library has it."""
        return self.skeleton.info(self.right_hip, self.left_hip)

    @classmethod
    def restore(cls, info: SkeletonInfo) -> Self:
        """The encoding of a library; FileFormatError if its skeleton is damaged, too large, or lacks its hips."""
        skeleton = Skeleton.restore(info)
        for hip in (info.right_hip, info.left_hip):
            if hip not in skeleton.bones:
                raise FileFormatError(f"hip bone '{hip}' is not in its skeleton")
        return cls(skeleton, info.right_hip, info.left_hip)

    @property
    def channels(self) -> int:
        """The number of channels of a frame."""
        return FIRST_BONE + 3 * len(self.skeleton)

    @property
    def velocities(self) -> slice:
        """The channels that are velocities: zero at rest."""
        return slice(TURN_RATE, LEFT + 1)

    @property
    def leading(self) -> NDArray[np.int64]:
        """The bones that define the heading: the hips."""
        return np.array([self.skeleton.index(self.right_hip), self.skeleton.index(self.left_hip)])

    @cached_property
    def silent(self) -> NDArray[np.int64]:
        """The channels that are zero by construction: none if the root lies off the line between the hips."""
        hips = self.leading
        opposite = np.allclose(self.skeleton.rest_direction[hips].sum(axis=0), 0.0, atol=1e-6)
        return FIRST_BONE + 3 * (hips if opposite else hips[:0])

    def encode(self, clip: Clip) -> Array:
        """The channels of a clip, shape (T, C); the first frame's velocities repeat the second's."""
        heading = self.heading(clip.rotation)
        in_heading = multiply(conjugate(yaw(heading))[:, None, :], clip.rotation)
        out = np.empty((len(clip), self.channels))
        out[:, HEIGHT] = clip.root_position[:, 2]
        out[:, FIRST_BONE:] = self.direction_channels(in_heading)
        turn = np.diff(heading)
        step = np.diff(clip.root_position[:, :2], axis=0)
        cos, sin = np.cos(heading[1:]), np.sin(heading[1:])
        out[1:, TURN_RATE] = (turn + np.pi) % (2.0 * np.pi) - np.pi
        out[1:, FORWARD] = cos * step[:, 0] + sin * step[:, 1]
        out[1:, LEFT] = cos * step[:, 1] - sin * step[:, 0]
        out[0, TURN_RATE : LEFT + 1] = out[1, TURN_RATE : LEFT + 1] if len(clip) > 1 else 0.0
        out[:, TURN_RATE : LEFT + 1] *= clip.rate
        return out

    def decode(self, channels: Array) -> Posture:
        """The postures of channels (..., C), of which they keep nothing; directions are normalised."""
        velocity, turn_rate = channels[..., FORWARD : LEFT + 1].copy(), channels[..., TURN_RATE].copy()
        return Posture(self.height(channels).copy(), velocity, turn_rate, self.rotations(channels))

    def direction_channels(self, rotation: Array) -> Array:
        """The channels from FIRST_BONE on of rotations (T, 1 + B, 4) in the heading frame, shape (T, C - 4)."""
        out = rotate(rotation[:, 1:], self.skeleton.rest_direction).reshape(len(rotation), -1)
        out[:, self.silent - FIRST_BONE] = 0.0
        return out

    def rotations(self, channels: Array) -> Array:
        """The rotations of channels (..., C), in the heading frame, shape (..., 1 + B, 4)."""
        return orient(self.skeleton, self.directions(channels))

    def directions(self, channels: Array) -> Array:
        """Unit vectors of the bones, shape (..., B, 3)."""
        return normalise(channels[..., FIRST_BONE:].reshape(*channels.shape[:-1], -1, 3))

    def height(self, channels: Array) -> Array:
        """Height of the root above the ground, shape (...), m."""
        return channels[..., HEIGHT]

    def heading(self, rotation: Array) -> Array:
        """The heading of bodies with bone rotations (..., 1 + B, 4), shape (...), rad."""
        right, left = self.skeleton.index(self.right_hip), self.skeleton.index(self.left_hip)
        rest, length = self.skeleton.rest_direction, self.skeleton.length
        line = rotate(rotation[..., left + 1, :], rest[left] * length[left])
        line = line - rotate(rotation[..., right + 1, :], rest[right] * length[right])
        return np.arctan2(-line[..., 0], line[..., 1])


@dataclass(frozen=True)
class JointRotations(BoneDirections):
    """The encoding with twists: bone directions, and for each a vector across the bone.

    For a skeleton of B bones a frame has 10 + 6 B channels: the 4 + 3 B of `BoneDirections`, then

        direction of the root's forward axis            3
        direction of each bone's side                   3 B
        direction of the root's left axis               3

    all in the heading frame. A direction and a side determine a rotation (`orientation.py` has to choose the twist),
    and unlike angles or quaternions they are continuous: networks may average the channels of two motions.
    """

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
    def _rest_side(self) -> rotations.FixedVectors:
        return rotations.FixedVectors(self._axes[1])

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
