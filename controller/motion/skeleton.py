"""A skeleton, a tree of rigid bones with one root joint; its postures and poses; and the thesis's 19 bones."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Self

import msgspec
import numpy as np

from controller.motion.rotations import BLOCK, Array, FixedVectors, Indices, by_blocks, multiply, yaw
from motiondeck_base.errors import FileFormatError

ROOT = -1
LONGEST_BONE = 10.0  # m, of a body in a library


class SkeletonInfo(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A skeleton in the header of a library; the joints of a rig have no hips."""

    name: str
    bones: list[str]
    parent: list[int]
    rest_direction: list[list[float]]
    length: list[float]
    right_hip: str
    left_hip: str


@dataclass(frozen=True, eq=False)
class Skeleton:
    """B bones, each parent before its children.

    A bone starts where its parent ends (or at the root) and ends in the joint of its name. FileFormatError if the
    shapes disagree, a parent follows its child, a name is used twice, or a number is not finite.
    """

    name: str
    bones: tuple[str, ...]
    parent: Indices  # the index of each bone's parent, shape (B,); ROOT at the root
    rest_direction: Array  # unit vectors in the rest pose, arms out sideways, shape (B, 3); x forward, y left, z up
    length: Array  # shape (B,), m

    is_rig: ClassVar[bool] = False
    """Whether its bones stand for the joints of a rig, and it has no body."""

    def __post_init__(self) -> None:
        count = len(self.bones)
        if count == 0:
            raise FileFormatError(f"skeleton '{self.name}' has no bones")
        shapes = (self.parent.shape, self.rest_direction.shape, self.length.shape)
        if shapes != ((count,), (count, 3), (count,)):
            raise FileFormatError(f"skeleton '{self.name}': {count} bones, but arrays of shape {shapes}")
        if not (np.isfinite(self.rest_direction).all() and np.isfinite(self.length).all()):
            raise FileFormatError(f"skeleton '{self.name}' holds a number that is not finite")
        if np.any(np.abs(np.linalg.norm(self.rest_direction, axis=1) - 1.0) > 1e-6) or np.any(self.length < 0):
            raise FileFormatError(f"skeleton '{self.name}': a rest direction is no unit vector or a length is below 0")
        for index, (bone, parent) in enumerate(zip(self.bones, self.parent, strict=True)):
            if not ROOT <= parent < index:
                raise FileFormatError(f"skeleton '{self.name}': bone '{bone}' does not follow its parent")
            if bone in self.bones[:index]:
                raise FileFormatError(f"skeleton '{self.name}': two bones are called '{bone}'")

    def __len__(self) -> int:
        return len(self.bones)

    def info(self, right_hip: str = "", left_hip: str = "") -> SkeletonInfo:
        """The skeleton as the header of a library has it."""
        arrays = self.parent.tolist(), self.rest_direction.tolist(), self.length.tolist()
        return SkeletonInfo(self.name, list(self.bones), *arrays, right_hip, left_hip)

    @classmethod
    def restore(cls, info: SkeletonInfo) -> Skeleton:
        """The skeleton of a header (FileFormatError as for the class, for what is no number, or too long a bone)."""
        try:
            arrays = (np.array(info.rest_direction, dtype=np.float64), np.array(info.length, dtype=np.float64))
            skeleton = Skeleton(info.name, tuple(info.bones), np.array(info.parent, dtype=np.int64), *arrays)
        except (ValueError, OverflowError) as error:
            raise FileFormatError(str(error)) from None
        if skeleton.length.max() > LONGEST_BONE:
            longest = skeleton.bones[int(skeleton.length.argmax())]
            raise FileFormatError(f"bone '{longest}' is {skeleton.length.max():.3g} m long, which no body has")
        return skeleton

    def index(self, bone: str) -> int:
        """The index of a bone by name (KeyError if there is none)."""
        try:
            return self.bones.index(bone)
        except ValueError:
            raise KeyError(bone) from None

    def children(self, bone: int) -> Indices:
        """The indices of the children of a bone (or of ROOT)."""
        return np.flatnonzero(self.parent == bone)

    @cached_property
    def first(self) -> Indices:
        """The bones at the root."""
        return self.children(ROOT)

    @cached_property
    def walk(self) -> tuple[tuple[int, list[float], list[int]], ...]:
        """Parent, rest direction and children of each bone as plain numbers."""
        return tuple(
            (int(parent), rest.tolist(), self.children(bone).tolist())
            for bone, (parent, rest) in enumerate(zip(self.parent, self.rest_direction, strict=True))
        )

    @cached_property
    def chain(self) -> Array:
        """Ancestors of each bone: 1 where the column's bone is the row's or above it, shape (B, B)."""
        chain = np.eye(len(self))
        for bone, parent in enumerate(self.parent):
            if parent != ROOT:
                chain[bone] += chain[parent]
        return chain

    @cached_property
    def _vectors(self) -> FixedVectors:
        return FixedVectors(self.rest_direction * self.length[:, None])

    @property
    def offsets(self) -> Array:
        """From the beginning of each bone to its end in the rest pose, shape (B, 3), m."""
        return self._vectors.vectors

    def with_offsets(self, offsets: Array) -> Self:
        """The same bones with other offsets (B, 3), m."""
        length = np.linalg.norm(offsets, axis=1)
        directions = offsets / np.where(length > 0.0, length, 1.0)[:, None]
        rest = np.where(length[:, None] > 0.0, directions, self.rest_direction)
        return replace(self, length=length, rest_direction=rest)

    @cached_property
    def leg_length(self) -> float:
        """Depth of the skeleton below its root in the rest pose, m."""
        return float(-np.min((self.chain @ self.offsets)[:, 2]))

    @property
    def stature(self) -> float:
        """Height of the skeleton in the rest pose, m."""
        return float(np.ptp((self.chain @ self.offsets)[:, 2]))

    def joints(self, root_position: Array, rotation: Array) -> Array:
        """Forward kinematics: positions of the root and of the ends of the bones, shape (..., 1 + B, 3), m.

        From root positions (..., 3), m, and world rotations of the root and of each bone (..., 1 + B, 4).
        """
        if rotation.ndim == 3 and len(rotation) > BLOCK:
            return by_blocks(self.joints, root_position, rotation)
        ends = root_position[..., None, :] + self.chain @ self._vectors.turned(rotation[..., 1:, :])
        return np.concatenate([root_position[..., None, :], ends], axis=-2)


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

    def at(self, root_position: Array, offsets: Array | None = None) -> Pose:
        """The pose (3,) there, m, that faces along x, of a body with these offsets."""
        return Pose(root_position, np.array(0.0), self.rotation, offsets=offsets)


@dataclass(slots=True)
class Pose:
    """A body in the world; leading axes (...) may be time."""

    root_position: Array  # (..., 3), m, z up
    heading: Array  # about z from x, (...), rad
    rotation: Array  # of the root and of each bone in the world, (..., 1 + B, 4)
    # Of the body whose motion it is, as `Skeleton.offsets`, if that is known; its legs are as long as those of the
    # skeleton that is posed.
    offsets: Array | None = field(default=None, kw_only=True)


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


# Bone, parent, and direction in the rest pose: arms out sideways, legs down, feet forward. Order and tree are those of
# Jaeger's patterns, which have no rest pose.
JAEGER_TREE: tuple[tuple[str, str, tuple[float, float, float]], ...] = (
    ("rhip", "root", (0.0, -1.0, 0.0)),
    ("rkne", "rhip", (0.0, 0.0, -1.0)),
    ("rank", "rkne", (0.0, 0.0, -1.0)),
    ("rfoo", "rank", (1.0, 0.0, 0.0)),
    ("lhip", "root", (0.0, 1.0, 0.0)),
    ("lkne", "lhip", (0.0, 0.0, -1.0)),
    ("lank", "lkne", (0.0, 0.0, -1.0)),
    ("lfoo", "lank", (1.0, 0.0, 0.0)),
    ("back", "root", (0.0, 0.0, 1.0)),
    ("neck", "back", (0.0, 0.0, 1.0)),
    ("head", "neck", (0.0, 0.0, 1.0)),
    ("rsho", "neck", (0.0, -1.0, 0.0)),
    ("relb", "rsho", (0.0, -1.0, 0.0)),
    ("rwri", "relb", (0.0, -1.0, 0.0)),
    ("rhan", "rwri", (0.0, -1.0, 0.0)),
    ("lsho", "neck", (0.0, 1.0, 0.0)),
    ("lelb", "lsho", (0.0, 1.0, 0.0)),
    ("lwri", "lelb", (0.0, 1.0, 0.0)),
    ("lhan", "lwri", (0.0, 1.0, 0.0)),
)
JAEGER_BONES = tuple(bone for bone, _, _ in JAEGER_TREE)
JAEGER_PARENT = tuple(ROOT if parent == "root" else JAEGER_BONES.index(parent) for _, parent, _ in JAEGER_TREE)
JAEGER_REST = tuple(rest for _, _, rest in JAEGER_TREE)


def thesis_skeleton(lengths: Array, name: str = "jaeger") -> Skeleton:
    """The skeleton of the thesis with the given lengths of its 19 bones, shape (19,), m."""
    return Skeleton(name, JAEGER_BONES, np.array(JAEGER_PARENT), np.array(JAEGER_REST), np.asarray(lengths, np.float64))
