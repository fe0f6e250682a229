"""The joints of a robot and the path of its root, for motions that were carried to the robot beforehand.

A frame has one channel a joint, as of `joint_angles`, and ten of the root:

    J            turn rate of the heading, rad a second of the motion, times LIGHT
    J + 1, 2     velocity of the root along the ground, forward and left, m a second of the motion, times LIGHT
    J + 3        height of the root, m
    J + 4 ...    the root's forward and left axes seen from the heading, 6

Unlike a quaternion, two axes are continuous while a root turns over. All are joints of the body, so that they are
switched, faded and blended as angles are. The body itself moves along x by CLOCK a second of the motion: the way that
it goes says how much of the motion has passed, at any tempo, which is what its rates are multiplied with.
"""

from collections.abc import Sequence
from functools import cached_property
from math import cos, sin, sqrt
from typing import ClassVar, Self

import numpy as np

from controller.motion.encodings.joint_angles import JointAngles, JointBody, angles_in
from controller.motion.rotations import Array, conjugate, multiply, rotate, yaw
from controller.motion.skeleton import Pose, SkeletonInfo
from motiondeck_base.errors import FileFormatError

CLOCK = 0.01  # m a second of the motion; so slow that it counts nothing beside the joints

_AXES = tuple(f"root {axis} {along}" for axis in ("ahead", "left") for along in "xyz")
ROOT = ("root turn", "root forward", "root sideways", "root height", *_AXES)
RATES = 3  # of ROOT, the first ones
LIGHT = 0.1  # of rates in their channels
LIGHTER = 0.1  # of rates as angles of the body, so that joins keep the limits of joints: rates change faster than these
HALF = 0.5  # likewise of the axes: a root turns faster than joints do, but not twice as fast


class RobotBody(JointBody):
    """The joints of a robot and those that stand for its root, the last ones."""

    @property
    def robot_joints(self) -> tuple[str, ...]:
        """The names of the robot's joints."""
        return self.bones[: -len(ROOT)]


class RobotJoints(JointAngles):
    """Joint angles with the path of a root, to channels and back."""

    name: ClassVar[str] = "joints and root"

    @classmethod
    def for_joints(cls, joints: Sequence[str]) -> Self:
        """The encoding for a robot's joints by name."""
        return cls(RobotBody.of((*joints, *ROOT)))

    @classmethod
    def restore(cls, info: SkeletonInfo) -> Self:
        """The encoding of a library with these joints; FileFormatError if those of the root are missing."""
        if tuple(info.bones[-len(ROOT) :]) != ROOT:
            raise FileFormatError(f"its joints do not end in those of a root: {', '.join(ROOT)}")
        return cls(RobotBody.of(info.bones))

    @cached_property
    def scale(self) -> Array:
        """The joint angle, rad, for a unit of each channel, shape (C,)."""
        scale = np.ones(self.channels)
        scale[self.velocities] = LIGHTER
        scale[-len(_AXES) :] = HALF
        return scale

    @property
    def velocities(self) -> slice:
        """The channels that are velocities: those of the root's path."""
        first = self.channels - len(ROOT)
        return slice(first, first + RATES)

    def encode_path(self, angles: Array, root: Array, heading: Array, rate: float) -> Array:
        """The channels of T frames at a rate, Hz, the first of which only leads to the second; shape (T - 1, C).

        Joint angles (T, J), rad; positions, m, and quaternions of the root (T, 7); the heading (T,), rad.
        """
        step, (cosine, sine) = rate * np.diff(root[:, :2], axis=0), (np.cos(heading[1:]), np.sin(heading[1:]))
        forward, left = cosine * step[:, 0] + sine * step[:, 1], cosine * step[:, 1] - sine * step[:, 0]
        seen = multiply(conjugate(yaw(heading)), root[:, 3:])[1:]
        axes = [rotate(seen, axis) for axis in np.eye(3)[:2]]
        rates = LIGHT * np.column_stack([rate * np.diff(heading), forward, left])
        return np.concatenate([angles[1:], np.column_stack([rates, root[1:, 2], *axes])], axis=1)

    def _standing(self, shape: tuple[int, ...]) -> tuple[Array, Array, Array]:
        """Height, velocity and turn rate of postures (...), which move with the clock."""
        height, velocity, turn_rate = super()._standing(shape)
        velocity[..., 0] = CLOCK
        return height, velocity, turn_rate


class RootPath:
    """Follows the path of the root from pose to pose."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begins anew: the next pose stands at the origin and faces along x."""
        self._clock: float | None = None
        self._x = self._y = self.heading = 0.0

    def __call__(self, pose: Pose) -> list[float]:
        """The root's position, m, and quaternion with the next pose of a `RobotBody`, 7 numbers."""
        turn, forward, left, height, *axes = angles_in(pose)[-len(ROOT) :].tolist()
        clock = float(pose.root_position[0])
        passed = (clock - self._clock) / (CLOCK * LIGHT * LIGHTER) if self._clock is not None else 0.0
        self._clock = clock
        self.heading += passed * turn
        cosine, sine = cos(self.heading), sin(self.heading)
        self._x += passed * (cosine * forward - sine * left)
        self._y += passed * (sine * forward + cosine * left)
        w, x, y, z = quaternion(*axes)
        c, s = cos(0.5 * self.heading), sin(0.5 * self.heading)
        return [self._x, self._y, height, c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w]


def quaternion(ax: float, ay: float, az: float, lx: float, ly: float, lz: float) -> tuple[float, float, float, float]:
    """The rotation whose forward axis has the first direction, and whose left axis lies towards the second."""
    length = sqrt(ax * ax + ay * ay + az * az) or 1.0
    ax, ay, az = ax / length, ay / length, az / length
    along = ax * lx + ay * ly + az * lz
    lx, ly, lz = lx - along * ax, ly - along * ay, lz - along * az
    length = sqrt(lx * lx + ly * ly + lz * lz) or 1.0
    lx, ly, lz = lx / length, ly / length, lz / length
    ux, uy, uz = ay * lz - az * ly, az * lx - ax * lz, ax * ly - ay * lx
    # Of the four ways to take a quaternion from a matrix the one that divides by its largest part.
    largest = max(ax + ly + uz, ax - ly - uz, ly - ax - uz, uz - ax - ly)
    big = 0.5 * sqrt(max(1.0 + largest, 1e-12))
    share = 0.25 / big
    if largest == ax + ly + uz:
        return big, share * (lz - uy), share * (ux - az), share * (ay - lx)
    if largest == ax - ly - uz:
        return share * (lz - uy), big, share * (lx + ay), share * (ux + az)
    if largest == ly - ax - uz:
        return share * (ux - az), share * (lx + ay), big, share * (uy + lz)
    return share * (ay - lx), share * (ux + az), share * (uy + lz), big
