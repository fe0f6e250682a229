"""Motions of a robot's joints, as programs that retarget, train and play them write them: .csv and .npz.

    .csv without a heading   root x y z, quaternion x y z w, joints: Unitree's LAFAN1 set and GMR's tables; 30 Hz
    .csv of BONES-SEED       Frame, root_translateX ... root_rotateZ, NAME_dof ...: cm and degrees; 120 Hz
    .npz                     fps, and joint_pos (ours, mjlab's), dof_pos (GMR's pickles as arrays) or MuJoCo's qpos

Angles are in rad but for BONES-SEED's. The take is of the joints alone: the root's path is left out. Their names are
those in the file; else those of `joints.txt` beside it or in a folder above, one a line, as `motiondeck retarget`
writes it (a joint after # follows another one and is left out); else 29 joints are those of Unitree's G1.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np

from controller.motion.clip import AS_FOUND, Clip, Format, ReadingOptions
from controller.motion.formats.npz_arrays import NpzArrays, npz_names
from controller.motion.formats.tables import first_row, heading, numbers
from controller.motion.formats.taught_clip import taught_clip
from controller.motion.rotations import Array, conjugate, rotate
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import Line, as_float, listed, read_lines

JOINTS_FILE = "joints.txt"
_FOLDERS_ABOVE = 8  # in which the file of names is looked for
_ROOT = 7  # numbers of the root: place and quaternion
_LEAST_COLUMNS = _ROOT + 3  # of a table without a heading
_UNITREE_RATE, _SEED_RATE = 30.0, 120.0  # Hz
_LARGEST = 1e6
_SEED = ("frame", *(f"root_{kind}{axis}" for kind in ("translate", "rotate") for axis in "xyz"))
_ARRAYS = ("joint_pos", "dof_pos", "qpos")
_LEG = "hip_pitch hip_roll hip_yaw knee ankle_pitch ankle_roll"
_ARM = "shoulder_pitch shoulder_roll shoulder_yaw elbow wrist_roll wrist_pitch wrist_yaw"
_TRUNK = "waist_yaw waist_roll waist_pitch"
_G1 = tuple(
    f"{side}{joint}_joint"
    for side, joints in (("left_", _LEG), ("right_", _LEG), ("", _TRUNK), ("left_", _ARM), ("right_", _ARM))
    for joint in joints.split()
)


def read_robot_motion(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The take of a robot's joints."""
    if options.unit is not None or options.up is not None:
        raise FileFormatError(f"{path}: a robot's motion has fixed units and axes: omit the options.")
    joints, rate, angles = _table(path) if Path(path).suffix.lower() == ".csv" else _arrays(path)
    rate = float(options.rate) if isinstance(options.rate, int | float) else rate
    folders = Path(path).absolute().parents[:_FOLDERS_ABOVE]
    file = next((folder / JOINTS_FILE for folder in folders if (folder / JOINTS_FILE).is_file()), None)
    listed_there = [line.strip() for line in read_lines(file, 1 << 20) if line.strip("# \t")] if file else []
    if joints is None:
        joints = [*map(_bare, listed_there)] or [*_G1]
        angles = angles[:, _ROOT:] if angles.shape[1] == len(joints) + _ROOT else angles
    if angles.shape[1] != len(joints):
        raise FileFormatError(
            f"{path}: {angles.shape[1]} numbers a frame are no angles of {len(joints)} joints ({listed(joints)}). "
            f"Write the robot's joints into a file {JOINTS_FILE} beside it, one a line, in their order."
        )
    followers = {_bare(name) for name in listed_there if name.startswith("#")}
    kept = [column for column, joint in enumerate(joints) if joint not in followers]
    names = options.renamed(tuple(joints[column] for column in kept), path)
    if not np.isfinite(angles).all():
        frame = int(np.argmin(np.isfinite(angles).all(axis=1)))
        raise FileFormatError(f"{path}: frame {frame} lacks an angle. Fill the gap.")
    with FileFormatError.placed(path, ". Are the angles in degrees? Write rad."):
        return taught_clip(Path(path).stem, names, rate, angles[:, kept], Path(path).name)


def _arrays(path: str | Path) -> tuple[list[str] | None, float, Array]:
    arrays = NpzArrays(path)
    angles, names = arrays.first(*_ARRAYS), arrays.words("joint_names", "dof_names")
    if angles is None or angles.ndim != 2 or not angles.size:
        shape = "none" if angles is None else str(angles.shape)
        raise FileFormatError(f"{path}: angles of shape {shape}, expected (frames, joints). Save it again.")
    if names is not None and angles.shape[1] == len(names) + _ROOT:  # qpos
        angles = angles[:, _ROOT:]
    if names is None and _breadth_first(arrays):
        raise FileFormatError(f"{path}: its joints are in Isaac Lab's order. Add an array 'joint_names'.")
    return None if names is None else [*names], arrays.rate(), angles


def _breadth_first(arrays: NpzArrays) -> bool:
    """Whether the first two bodies after the root lie on different sides of it, as in Isaac Lab's order."""
    place, turn = arrays.first("body_pos_w"), arrays.first("body_quat_w")
    if place is None or turn is None or place.ndim != 3 or place.shape[1] < 3 or turn.shape[:2] != place.shape[:2]:
        return False
    seen = rotate(conjugate(turn[:, :1]), place[:, 1:3] - place[:, :1])
    return bool(np.median(seen[:, 0, 1] * seen[:, 1, 1]) < 0.0)


def _table(path: str | Path) -> tuple[list[str] | None, float, Array]:
    head, rows, separator, _ = heading(path)
    heads = head.words
    if tuple(word.lower() for word in heads)[: len(_SEED)] == _SEED:
        table = numbers(path, rows, len(heads), separator, _LARGEST)
        if skipped := next((at for at, (one, other) in enumerate(pairwise(table[:, 0])) if other - one != 1.0), None):
            raise Line(path, rows[skipped + 1][0], []).error("frames are missing before this one. Fetch it again.")
        joints = [head.removesuffix("_dof") for head in heads[len(_SEED) :]]
        return joints, _SEED_RATE, np.radians(table[:, len(_SEED) :])
    return None, _UNITREE_RATE, numbers(path, [(head.number, separator.join(heads)), *rows], len(heads), separator)


def _bare(name: str) -> str:
    return name.lstrip("# \t")


def _is_robots(path: Path) -> bool:
    if path.suffix.lower() == ".npz":
        return any(name in npz_names(path) for name in _ARRAYS)
    heads = [head.lower() for head in first_row(path)]
    if tuple(heads[: len(_SEED)]) == _SEED:
        return True
    return len(heads) >= _LEAST_COLUMNS and all(as_float(head) is not None for head in heads)


FORMAT = Format(suffixes=(".csv", ".npz"), read=read_robot_motion, matches=_is_robots)
