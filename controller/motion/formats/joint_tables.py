"""Joint angles over time: .csv with a line a frame, .npz with an array a column.

    # plays = once
    time_s,jaw_deg,left_lid_rad
    0.00,0,0.12

A column is named as its joint, with the unit behind: _deg or _rad; the unit of others is that of the options. Comments
above the heading, or arrays, say how the motion `plays` (without it that is found out) and its `rate` (`fps`), which
the times tell too. Of a table of `JointMotion`, in rad, the root is left out. It is written in rad, rounded to a
picoradian, so that what is read and written again is the same.
"""

import io
from collections.abc import Callable
from pathlib import Path
from typing import get_args

import numpy as np

from controller.motion.clip import ANGLE_UNITS, AS_FOUND, Clip, Format, Plays, ReadingOptions
from controller.motion.formats.npz_arrays import NpzArrays, npz_names
from controller.motion.formats.positions import is_table
from controller.motion.formats.tables import TIMES, even_times, first_row, heading, numbers
from controller.motion.formats.taught_clip import rounded, taught_clip
from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import Line, as_float, write_file

_LARGEST = 1e6
_NO_COLUMN = ("plays", "fps")
ROOT_COLUMNS = [f"root_{name}" for name in ("x", "y", "z", "qw", "qx", "qy", "qz")]  # of `JointMotion`, in front


def read_joint_table(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The take of the joints that the columns name."""
    if options.up is not None:
        raise FileFormatError(f"{path}: joint angles have no axis that is up: omit the option.")
    wrong, lines, columns, table, notes = _lines(path) if Path(path).suffix.lower() == ".csv" else _arrays(path)
    named = [_joint_of(column, options.unit, wrong) for column in columns]
    gaps = np.argwhere(np.isnan(table))
    if len(gaps):
        row, column = gaps[0]
        raise lines[row].error(f"{['the time', *columns][column]} is missing. Fill the gap.")
    rate, angles = even_times(table[:, 0], table[:, 1:] * [unit for _, unit in named], lines)
    said = as_float(notes.get("rate", ""))
    names = options.renamed(tuple(joint for joint, _ in named), path)
    plays = next((one for one in get_args(Plays) if one == notes.get("plays")), None)
    # Times have few digits: the rate that is said is meant.
    rate = said if said and (len(table) == 1 or abs(said - rate) < 1e-3 * rate) else rate
    with FileFormatError.placed(path, ". Are they degrees? Name columns so (jaw_deg)."):
        return taught_clip(Path(path).stem, names, rate, angles, Path(path).name, plays)


_Wrong = Callable[[str], FileFormatError]
_Columns = tuple[_Wrong, list[Line], list[str], Array, dict[str, str]]
"""An error of the heading, lines, the names of the joints' columns, time and columns (T, 1 + J), and notes."""


def _lines(path: str | Path) -> _Columns:
    head, rows, separator, comments = heading(path)
    table = numbers(path, rows, len(head.words), separator, _LARGEST)
    said = [text.strip("# \t").partition("=") for text in comments]
    notes, columns = {key.strip(): value.strip() for key, _, value in said}, head.words[1:]
    if columns[: len(ROOT_COLUMNS)] == ROOT_COLUMNS:
        columns = [f"{joint}_rad" for joint in columns[len(ROOT_COLUMNS) :]]
        table = np.delete(table, np.arange(1, 1 + len(ROOT_COLUMNS)), axis=1)
    return head.error, [Line(path, number, []) for number, _ in rows], columns, table, notes


def _arrays(path: str | Path) -> _Columns:
    arrays = NpzArrays(path)
    time = next(name for name in arrays.names if name.lower() in TIMES)
    columns = [name for name in arrays.names if name not in (time, *_NO_COLUMN)]
    found = [arrays.first(name) for name in (time, *columns)]
    table = [column for column in found if column is not None and column.ndim == 1]
    if len(table) < len(found) or len({len(column) for column in table}) > 1 or not len(table[0]) or not columns:
        raise FileFormatError(f"{path}: one number a frame is needed of '{time}' and of every joint. Save it again.")
    plays = arrays.words("plays")
    notes = {"rate": str(arrays.rate())} if "fps" in arrays.names else {}
    lines = [Line(path, frame, []) for frame in range(1, len(table[0]) + 1)]
    notes |= {"plays": plays[0]} if plays else {}
    return lambda text: FileFormatError(f"{path}: {text}"), lines, columns, np.stack(table, axis=1), notes


def _joint_of(column: str, unit: float | None, wrong: _Wrong) -> tuple[str, float]:
    """The joint of a column, and its unit in rad."""
    joint, _, ending = column.rpartition("_")
    if joint and ending.lower() in ANGLE_UNITS:
        return joint, ANGLE_UNITS[ending.lower()]
    if unit is None:
        raise wrong(f"'{column}' has no unit. Call it {column}_deg or {column}_rad, or give --unit deg or --unit rad.")
    return column, unit


def save_joint_table(clip: Clip, path: Path) -> None:
    """Writes a clip of a joint body as .csv or .npz."""
    angles = rounded(clip)
    time, columns = np.arange(len(clip)) / clip.rate, [f"{joint}_rad" for joint in clip.skeleton.bones]
    if path.suffix.lower() == ".csv":
        notes = [f"# plays = {clip.plays}"] if clip.plays else []
        heading = [*notes, f"# rate = {clip.rate!r}", ",".join(["time_s", *columns])]
        rows = [",".join([f"{at:.6f}", *map(repr, row)]) for at, row in zip(time, angles.tolist(), strict=True)]
        write_file(path, "\n".join([*heading, *rows, ""]).encode())
        return
    packed, arrays = io.BytesIO(), dict(zip(columns, angles.T, strict=True))
    said = {"plays": np.array(clip.plays)} if clip.plays else {}
    np.savez(packed, **said, fps=np.array(clip.rate), time_s=time, **arrays)
    write_file(path, packed.getvalue())


def _is_joint_table(path: Path) -> bool:
    if path.suffix.lower() == ".npz":
        names = {name.lower() for name in npz_names(path)}
        return bool(names & set(TIMES)) and any(name.endswith(("_deg", "_rad")) for name in names)
    heads = [head.lower() for head in first_row(path)]
    if len(heads) < 2 or heads[0] not in TIMES:
        return False
    return any(head.endswith(("_deg", "_rad")) for head in heads) or ROOT_COLUMNS[-1] in heads or not is_table(path)


FORMAT = Format(suffixes=(".csv", ".npz"), read=read_joint_table, matches=_is_joint_table)
