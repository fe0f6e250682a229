"""A rig's joints as a body, so that what plays, fades and compares bodies does the same with joints taught by hand.

Each joint is a bone of 4 m on the root, which points forward at angle 0 and turns about the vertical by a quarter of
the joint's angle. So every angle within two turns either way has a direction of its own (a fade never goes the wrong
way round), and a difference that a body would show in mm is one of the angle in mrad. A frame has one channel a joint:

    c            angle of joint c, rad
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from controller.motion.clip import Clip
from controller.motion.posture import Pose, Posture
from controller.motion.rotations import Array, yaw
from controller.motion.skeleton import ROOT, Skeleton, SkeletonInfo
from motiondeck_base.arrays_file import Kind, StoredArrays, read_arrays, write_arrays
from motiondeck_base.errors import FileFormatError, UnknownNameError
from motiondeck_base.toml_file import shaped

_LEVER = 4.0  # m
_PART = 1.0 / _LEVER  # of the joint's angle that the bone turns
_FARTHEST = 4.0 * np.pi  # rad
_KIND = Kind("taught clip", "motiondeck-clip", 2, "`motiondeck rig teach`", (1,))

Plays = Literal["loop", "once"]
"""Whether a motion goes on for ever, or ends in a pose and holds it."""


class JointBody(Skeleton):
    """The body that a rig's joints make."""

    is_rig = True

    @classmethod
    def of(cls, joints: Sequence[str]) -> JointBody:
        """The body of joints with these names.

        Raises:
            FileFormatError: if there are none, or a name is used twice.
        """
        count = len(joints)
        forward = np.tile([1.0, 0.0, 0.0], (count, 1))
        return cls("joints", tuple(joints), np.full(count, ROOT), forward, np.full(count, _LEVER))

    @property
    def leg_length(self) -> float:  # pyright: ignore[reportIncompatibleVariableOverride]
        """1 m: it stands on nothing, and nothing about it grows with its size."""
        return 1.0


@dataclass(frozen=True)
class JointAngles:
    """Clips of a joint body to channels and back; it has the interface of `bone_directions.BoneDirections`.

    Attributes:
        skeleton: the joints.
    """

    skeleton: JointBody

    name: ClassVar[str] = "joint angles"
    twist_by_rule: ClassVar[bool] = False

    @classmethod
    def restore(cls, info: SkeletonInfo) -> JointAngles:
        """The encoding of a library with these joints.

        Raises:
            FileFormatError: as `JointBody.of`.
        """
        return cls(JointBody.of(info.bones))

    def skeleton_info(self) -> SkeletonInfo:
        """The joints as the header of a library has them."""
        return self.skeleton.info()

    @property
    def channels(self) -> int:
        """How many channels a frame has."""
        return len(self.skeleton)

    @property
    def velocities(self) -> slice:
        """The channels that are velocities: none."""
        return slice(0, 0)

    @property
    def leading(self) -> NDArray[np.int64]:
        """The bones that the root's heading follows: any, since it never turns."""
        return np.arange(self.channels)

    def encode(self, clip: Clip) -> Array:
        """The angles of a clip, shape (T, J), rad."""
        return angles_of(clip.rotation[:, 1:])

    def decode(self, channels: Array) -> Posture:
        """The postures of angles (..., J); what stands nowhere stands 1 m high and does not walk."""
        leading = channels.shape[:-1]
        rotation = np.zeros((*leading, 1 + self.channels, 4))
        rotation[..., 0, 0] = 1.0
        rotation[..., 1:, :] = yaw(_PART * channels)
        return Posture(np.ones(leading), np.zeros((*leading, 2)), np.zeros(leading), rotation)

    def directions(self, channels: Array) -> Array:
        """Where the bones point, shape (..., J, 3)."""
        turned = _PART * channels
        return np.stack([np.cos(turned), np.sin(turned), np.zeros_like(turned)], axis=-1)

    def height(self, channels: Array) -> Array:
        """Of the root above the ground, shape (...), m."""
        return np.ones(channels.shape[:-1])


class JointRetargeter:
    """Carries poses of a joint body to the joints of the same names; fits `deck.interfaces.Retargeter`.

    Args:
        body: whose poses will come.
        joints: of the robot.
        rest: targets of the joints that the body lacks, shape (J,), rad.

    Raises:
        UnknownNameError: if the body has a joint that the robot has not.
    """

    def __init__(self, body: Skeleton, joints: Sequence[str], rest: Array) -> None:
        for name in body.bones:
            if name not in joints:
                raise UnknownNameError.among("joint of this robot", name, joints)
        self._order = np.array([joints.index(name) for name in body.bones])
        self._targets = rest.copy()

    def __call__(self, pose: Pose) -> Array:
        """Joint targets, shape (J,), rad; the array is reused by the next call."""
        self._targets[self._order] = angles_of(pose.rotation[1:])
        return self._targets


def angles_of(rotation: Array) -> Array:
    """The joints' angles (..., J), rad, of the rotations (..., J, 4) of a joint body that has not been turned."""
    w, z = rotation[..., 0], rotation[..., 3]
    return 2.0 * _LEVER * np.arctan2(np.where(w < 0.0, -z, z), np.abs(w))


class _ClipHeader(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """The header of a taught clip's file."""

    version: int
    name: str
    joints: list[str]
    rate: float
    source: str
    plays: Plays = "loop"


def taught_clip(name: str, joints: Sequence[str], rate: float, angles: Array, source: str = "") -> Clip:
    """The clip of joint angles (T, J), rad, at a rate in Hz.

    Raises:
        FileFormatError: if shapes disagree, there are no frames, or an angle is not finite or beyond two turns.
    """
    body = JointBody.of(joints)
    if angles.ndim != 2 or angles.shape[1] != len(body):
        raise FileFormatError(f"clip '{name}': angles of shape {angles.shape} for {len(body)} joints")
    if not (np.abs(angles) < _FARTHEST).all():
        raise FileFormatError(f"clip '{name}' holds an angle that is not finite or beyond two turns")
    posture = JointAngles(body).decode(angles)
    position = np.zeros((len(angles), 3))
    position[:, 2] = posture.height
    return Clip(name, body, rate, position, posture.rotation, source)


def save_taught_clip(clip: Clip, path: Path, plays: Plays = "loop") -> None:
    """Writes a clip of a joint body and how it is to be played once it is learned, whole or not at all.

    Raises:
        FileFormatError: if the folder cannot be written.
    """
    header = _ClipHeader(_KIND.version, clip.name, list(clip.skeleton.bones), clip.rate, clip.source, plays)
    write_arrays(path, _KIND, header, {"angles": angles_of(clip.rotation[:, 1:])})


def read_taught_clip(path: str | Path) -> Clip:
    """Reads the clip that `save_taught_clip` has written.

    Raises:
        FileFormatError: one line that names the file and what is wrong with it.
    """
    header, stored = _read(Path(path))
    angles = stored.take("angles", stored.size("angles"), len(header.joints), kind=np.float64)
    stored.finish()
    try:
        return taught_clip(header.name, header.joints, header.rate, angles, header.source)
    except FileFormatError as error:
        raise FileFormatError(f"{path}: {error}") from None


def how_taught(path: str | Path) -> Plays:
    """How the motion in a file of `save_taught_clip` is to be played.

    Raises:
        FileFormatError: as `read_taught_clip`.
    """
    return _read(Path(path))[0].plays


def _read(path: Path) -> tuple[_ClipHeader, StoredArrays]:
    tree, stored = read_arrays(path, _KIND)
    header = shaped(tree, _ClipHeader, f"{path} (header)")
    if not header.joints:
        raise FileFormatError(f"{path}: its header names no joints")
    return header, stored
