"""Clips taught to a rig by hand (.clip): joint angles in a safetensors file, and whether they loop."""

from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from controller.motion.clip import AS_FOUND, Clip, Format, Plays, ReadingOptions
from controller.motion.encodings.joint_angles import JointAngles, JointBody, angles_of
from controller.motion.rotations import Array
from motiondeck_base.arrays_file import Kind, read_arrays, write_arrays
from motiondeck_base.errors import FileFormatError
from motiondeck_base.toml_file import shaped

_LARGEST_ANGLE = 4.0 * np.pi  # rad
_DIGITS = 12  # of an angle in rad that are written
_KIND = Kind("taught clip", "motiondeck-clip", 2, "`motiondeck rig teach`", (1,))


class _ClipHeader(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    version: int
    name: str
    joints: list[str]
    rate: float
    source: str
    plays: Plays = "loop"


def taught_clip(
    name: str, joints: Sequence[str], rate: float, angles: Array, source: str = "", plays: Plays | None = None
) -> Clip:
    """The clip of joint angles (T, J), rad, at a rate in Hz (FileFormatError for angles beyond two turns)."""
    body = JointBody.of(joints)
    if angles.ndim != 2 or angles.shape[1] != len(body):
        raise FileFormatError(f"clip '{name}': angles of shape {angles.shape} for {len(body)} joints")
    if not (np.abs(angles) < _LARGEST_ANGLE).all():
        raise FileFormatError(f"clip '{name}' holds an angle that is not finite or beyond two turns")
    posture = JointAngles(body).decode(angles)
    position = np.zeros((len(angles), 3))
    position[:, 2] = posture.height
    return Clip(name, body, rate, position, posture.rotation, source, plays=plays)


def save_taught_clip(clip: Clip, path: Path, plays: Plays | None = None) -> None:
    """Writes a clip of a joint body and how to play it once it is learned (None: as it says), atomically."""
    plays = plays or clip.plays or "loop"
    header = _ClipHeader(_KIND.version, clip.name, list(clip.skeleton.bones), clip.rate, clip.source, plays)
    write_arrays(path, _KIND, header, {"angles": rounded(clip)})


def read_taught_clip(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """Reads the clip that `save_taught_clip` has written."""
    options.refuse(path)
    tree, stored = read_arrays(Path(path), _KIND)
    header = shaped(tree, _ClipHeader, f"{path} (header)")
    if not header.joints:
        raise FileFormatError(f"{path}: its header names no joints")
    angles = stored.take("angles", stored.size("angles"), len(header.joints), kind=np.float64)
    stored.finish()
    with FileFormatError.placed(path):
        return taught_clip(header.name, header.joints, header.rate, angles, header.source, header.plays)


def rounded(clip: Clip) -> Array:
    """The angles (T, J) of a clip of a joint body, rad, as files have them: they are the same when read again."""
    return np.round(angles_of(clip.rotation[:, 1:]), _DIGITS) + 0.0


FORMAT = Format(suffixes=(".clip",), read=read_taught_clip)
