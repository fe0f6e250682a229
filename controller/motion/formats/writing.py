"""Writes clips for other programs: BVH with rotations, CSV with positions of joints or markers; and joint angles."""

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from controller.motion.clip import Clip
from controller.motion.formats.joint_tables import save_joint_table
from controller.motion.formats.taught_clip import save_taught_clip
from controller.motion.rotations import Array, conjugate, multiply, rotate
from controller.motion.skeleton import ROOT
from controller.motion.up_axis import TO_OURS
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import write_file

CENTIMETRES = 100.0  # the usual unit of BVH
FORMATS, JOINT_FORMATS = (".bvh", ".csv"), (".clip", ".csv", ".npz")
# The middle angle of the three must stay off 90 degrees: people turn about the vertical, y, and seldom twist a leg.
ROOT_ORDER, ORDER = "YXZ", "ZYX"


def write_clip(clip: Clip, path: Path) -> None:
    """Writes a clip as .bvh or .csv, joint angles as .clip, .csv or .npz; FileFormatError for another suffix."""
    formats = JOINT_FORMATS if clip.skeleton.is_rig else FORMATS
    if path.suffix.lower() not in formats:
        what = "joint angles" if clip.skeleton.is_rig else "clips"
        raise FileFormatError(f"{path}: {what} are written as {' or '.join(formats)}. Name the file so.")
    if clip.skeleton.is_rig:
        write = save_taught_clip if path.suffix.lower() == ".clip" else save_joint_table
        write(clip, path)
        return
    bvh = path.suffix.lower() == ".bvh"
    text = bvh_text(clip) if bvh else csv_text(("root", *clip.skeleton.bones), clip.joints(), clip.rate)
    write_file(path, text.encode())


def bvh_text(clip: Clip) -> str:
    """A clip as BVH: y up, x left, z forward, cm; one joint a bone, at its start and with its name."""
    # Reading it again gives the same bones, and joints within a micrometre a bone.
    skeleton = clip.skeleton
    to_file = conjugate(TO_OURS["y"])
    vector = rotate(to_file, skeleton.rest_direction * skeleton.length[:, None]) * CENTIMETRES
    turn = multiply(multiply(np.broadcast_to(to_file, clip.rotation.shape), clip.rotation), conjugate(to_file))
    local = turn.copy()
    local[:, 1:] = multiply(conjugate(turn[:, skeleton.parent + 1]), turn[:, 1:])
    angles = np.degrees(_angles(local, ORDER))  # (T, 1 + B, 3)
    angles[:, 0] = np.degrees(_angles(local[:, :1], ROOT_ORDER))[:, 0]

    lines: list[str] = ["HIERARCHY"]
    order: list[int] = []  # of the joints in the file: 0 is the root, 1 + b a bone

    def joint(bone: int, depth: int) -> None:
        pad = "  " * depth
        order.append(1 + bone)
        above = skeleton.parent[bone] if bone != ROOT else ROOT
        start = np.zeros(3) if above == ROOT else vector[above]
        name = "root" if bone == ROOT else skeleton.bones[bone]
        channels = "CHANNELS 3" if bone != ROOT else "CHANNELS 6 Xposition Yposition Zposition"
        turns = " ".join(f"{axis}rotation" for axis in (ORDER if bone != ROOT else ROOT_ORDER))
        lines.extend([f"{pad}{'ROOT' if bone == ROOT else 'JOINT'} {'_'.join(name.split())}", f"{pad}{{"])
        lines.extend([f"{pad}  OFFSET {_numbers(start)}", f"{pad}  {channels} {turns}"])
        children = skeleton.children(bone)
        for child in children:
            joint(int(child), depth + 1)
        if len(children) == 0:
            lines.extend([f"{pad}  End Site", f"{pad}  {{", f"{pad}    OFFSET {_numbers(vector[bone])}", f"{pad}  }}"])
        lines.append(f"{pad}}}")

    joint(ROOT, 0)
    lines += ["MOTION", f"Frames: {len(clip)}", f"Frame Time: {1.0 / clip.rate:.8f}"]
    place = rotate(to_file, clip.root_position) * CENTIMETRES
    rows = np.concatenate([place, angles[:, order].reshape(len(clip), -1)], axis=1)
    lines += [_numbers(row) for row in rows]
    return "\n".join(lines) + "\n"


def csv_text(names: Sequence[str], places: Array, rate: float) -> str:
    """Positions (T, N, 3), m, of markers or of ends of bones as CSV: time in s, then x, y, z of each, empty for NaN."""
    plain = [name.replace(",", " ").replace('"', "") for name in names]
    lines = [",".join(["time_s", *(f"{name}.{axis}" for name in plain for axis in "xyz")])]
    for frame, row in enumerate(places.reshape(len(places), -1)):
        lines.append(f"{frame / rate:.6f}," + ",".join("" if np.isnan(value) else f"{value:.6f}" for value in row))
    return "\n".join(lines) + "\n"


def _numbers(values: Array) -> str:
    return " ".join(f"{value:.6f}" for value in values + 0.0)


def _angles(q: Array, order: str) -> Array:
    """Euler angles (T, N, 3), rad, unwrapped in time; the rotation about the last axis comes first."""
    from scipy.spatial.transform import Rotation  # slow to import

    with warnings.catch_warnings(action="ignore"):  # where the outer two axes coincide, the last angle is zero
        angles = Rotation.from_quat(q.reshape(-1, 4), scalar_first=True).as_euler(order)
    return np.unwrap(angles.reshape(*q.shape[:-1], 3), axis=0)
