"""The joints of a rig as a body, so that joint angles are played, blended and compared like bodies.

Each joint is a bone of 4 m on the root, which points forward at angle 0 and turns about the vertical by a quarter of
the joint's angle. So all angles within two turns either way have different directions (a blend never goes the wrong way
round), and a difference of 1 mm of the body is one of 1 mrad of the angle. A frame has one channel a joint:

    c            angle of joint c, rad
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from controller.motion.clip import Clip
from controller.motion.rotations import Array, Indices
from controller.motion.skeleton import ROOT, Pose, Posture, Skeleton, SkeletonInfo
from motiondeck_base.errors import UnknownNameError

_LEVER = 4.0  # m
_AHEAD = np.array(0.0)  # the heading of all poses
SHARE = 1.0 / _LEVER  # of the joint's angle that the bone turns


class JointBody(Skeleton):
    """The joints of a rig as bones on one root."""

    is_rig = True

    @classmethod
    def of(cls, joints: Sequence[str]) -> Self:
        """The body of joints with these names (FileFormatError if there are none, or a name is used twice)."""
        count = len(joints)
        forward = np.tile([1.0, 0.0, 0.0], (count, 1))
        return cls("joints", tuple(joints), np.full(count, ROOT), forward, np.full(count, _LEVER))

    @property
    def leg_length(self) -> float:  # pyright: ignore[reportIncompatibleVariableOverride]
        """1 m, by definition."""
        return 1.0


class _Jointed:
    """Rotations from angles of joints, or angles from rotations, once somebody asks: most ticks need only angles."""

    __slots__ = ()
    angles: Array  # of the joints, shape (..., J), rad
    rotation: Array

    def __getattr__(self, name: str) -> Array:
        if name == "rotation":
            self.rotation = _turned(self.angles)
        elif name == "angles":
            self.angles = angles_of(self.rotation[..., 1:, :])
        else:
            raise AttributeError(name)
        return getattr(self, name)


class JointPosture(_Jointed, Posture):
    """Postures of a joint body."""

    __slots__ = ("angles",)

    def at(self, root_position: Array, offsets: Array | None = None) -> Pose:
        """As of `Posture`."""
        pose = JointPose.__new__(JointPose)
        pose.root_position, pose.heading, pose.angles = root_position, _AHEAD, self.angles
        pose.offsets = offsets
        return pose


class JointPose(_Jointed, Pose):
    """One pose of a joint body."""

    __slots__ = ("angles",)


@dataclass(frozen=True)
class JointAngles:
    """Clips of a joint body to channels and back; the same interface as `bone_directions.BoneDirections`."""

    skeleton: JointBody

    name: ClassVar[str] = "joint angles"
    twist_by_rule: ClassVar[bool] = False

    @classmethod
    def restore(cls, info: SkeletonInfo) -> Self:
        """The encoding of a library with these joints (FileFormatError as `JointBody.of`)."""
        return cls(JointBody.of(info.bones))

    def skeleton_info(self) -> SkeletonInfo:
        """The joints as the header of a library has them."""
        return self.skeleton.info()

    @property
    def channels(self) -> int:
        """The number of channels of a frame."""
        return len(self.skeleton)

    @cached_property
    def scale(self) -> Array:
        """The joint angle, rad, for a unit of each channel, shape (J,)."""
        return np.ones(self.channels)

    @property
    def velocities(self) -> slice:
        """The channels that are velocities: none."""
        return slice(0, 0)

    @property
    def leading(self) -> Indices:
        """The bones that the root's heading follows: any, since it is constant."""
        return np.arange(self.channels)

    def encode(self, clip: Clip) -> Array:
        """The angles of a clip, shape (T, J), rad."""
        return angles_of(clip.rotation[:, 1:]) / self.scale

    def decode(self, channels: Array) -> Posture:
        """The postures of angles (..., J): 1 m high, at rest."""
        posture = JointPosture.__new__(JointPosture)
        still = self._still if channels.ndim == 1 else self._standing(channels.shape[:-1])
        posture.height, posture.velocity, posture.turn_rate = still
        posture.angles = self.scale * channels
        return posture

    def _standing(self, shape: tuple[int, ...]) -> tuple[Array, Array, Array]:
        """Height, velocity and turn rate of postures (...)."""
        return np.ones(shape), np.zeros((*shape, 2)), np.zeros(shape)

    @cached_property
    def _still(self) -> tuple[Array, Array, Array]:
        return self._standing(())

    def directions(self, channels: Array) -> Array:
        """Directions of the bones, shape (..., J, 3)."""
        turned = SHARE * self.scale * channels
        return np.stack([np.cos(turned), np.sin(turned), np.zeros_like(turned)], axis=-1)

    def height(self, channels: Array) -> Array:
        """Height of the root above the ground, shape (...), m."""
        return np.ones(channels.shape[:-1])


class JointRetargeter:
    """Carries poses of a joint body to the joints of the same names; a `deck.interfaces.Retargeter`.

    Joints of the robot that the body lacks keep their targets in `rest`, shape (J,), rad. UnknownNameError if the body
    has a joint that the robot lacks.
    """

    def __init__(
        self, body: Skeleton, joints: Sequence[str], rest: Array, carried: Sequence[str] | None = None
    ) -> None:
        """Carries all bones of the body, or the first ones, `carried`."""
        carried = body.bones if carried is None else carried
        order, self._count = UnknownNameError.indices("joint of this robot", carried, joints), len(carried)
        self._order = slice(self._count) if order == [*range(self._count)] else np.array(order)  # a slice is quicker
        self._targets = rest.copy()

    def __call__(self, pose: Pose) -> Array:
        """Joint targets, shape (J,), rad; the next call overwrites the array."""
        self._targets[self._order] = angles_in(pose)[: self._count]
        return self._targets


def angles_in(pose: Pose) -> Array:
    """The joint angles (J,), rad, of a pose of a joint body."""
    return pose.angles if isinstance(pose, JointPose) else angles_of(pose.rotation[1:])


def angles_of(rotation: Array) -> Array:
    """The joint angles (..., J), rad, of rotations (..., J, 4) of a joint body whose root is not rotated."""
    return 2.0 * _LEVER * np.arctan(rotation[..., 3] / rotation[..., 0])


def _turned(angles: Array) -> Array:
    """The rotations (..., 1 + J, 4) of a joint body at angles (..., J), rad."""
    rotation = np.zeros((*angles.shape[:-1], 1 + angles.shape[-1], 4))
    rotation[..., 0, 0] = 1.0
    half = 0.5 * SHARE * angles  # as of `rotations.yaw`, in fewer calls
    np.cos(half, out=rotation[..., 1:, 0])
    np.sin(half, out=rotation[..., 1:, 3])
    return rotation
