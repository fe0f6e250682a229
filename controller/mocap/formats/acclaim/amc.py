"""Acclaim recordings (AMC): the angles of the bones of one ASF skeleton, frame by frame.

A frame is a line with its number, then one line per bone: its name and the values of its channels, in the order the
skeleton gives. The file holds no rate; CMU and HDM05 recorded at 120 Hz.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import TypeAlias

import numpy as np

from controller.mocap.clip import Clip
from controller.mocap.formats.acclaim.axes import AcclaimSkeleton, from_acclaim, turned
from controller.rotations import Array, conjugate, continuous, multiply
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import Line, listed, read_lines, shortened

Columns: TypeAlias = dict[str, slice]  # which of a frame's values belong to the root and to each bone
Row: TypeAlias = list[float | None]  # one frame; None where no line has come yet


def read_amc(path: str | Path, skeleton: AcclaimSkeleton, rate: float = 120.0) -> Clip:
    """The motion in an AMC file.

    Args:
        path: of the file.
        skeleton: the one it was recorded with.
        rate: frames per second, Hz.

    Raises:
        FileFormatError: naming file and line, if it cannot be read, does not follow the format or does not fit the
            skeleton.
    """
    names = ("root", *skeleton.skeleton.bones)
    ends = np.cumsum([0, *(len(channels) for channels in skeleton.dof)]).tolist()
    columns = {name: slice(*span) for name, span in zip(names, pairwise(ends), strict=True)}
    values, angle_unit = _values(path, skeleton, columns)

    place = np.zeros((len(values), 3))
    for channel, value in zip(skeleton.dof[0], values[:, columns["root"]].T, strict=True):
        if channel[0] == "t":
            place[:, "xyz".index(channel[1])] = value * skeleton.length_unit

    rotation = np.empty((len(values), len(names), 4))
    parents = (None, *(skeleton.skeleton.parent + 1))
    for bone, (name, parent) in enumerate(zip(names, parents, strict=True)):
        turns = [
            (channel[1], value * angle_unit)
            for channel, value in zip(skeleton.dof[bone], values[:, columns[name]].T, strict=True)
            if channel[0] == "r"
        ]
        axis = skeleton.axis[bone]
        local = multiply(multiply(axis, turned(turns)), conjugate(axis))
        rotation[:, bone] = local if parent is None else multiply(rotation[:, parent], local)

    return Clip(
        name=Path(path).stem,
        skeleton=skeleton.skeleton,
        rate=rate,
        root_position=from_acclaim(place) + skeleton.root_position,
        rotation=continuous(rotation),
        source=Path(path).name,
    )


def _values(path: str | Path, skeleton: AcclaimSkeleton, columns: Columns) -> tuple[Array, float]:
    """The values as they stand in the file, shape (frames, channels), and what one angle is in rad."""
    angle_unit = skeleton.angle_unit
    width = sum(len(channels) for channels in skeleton.dof)
    rows: list[Row] = []
    row: Row | None = None
    begin: Line | None = None  # the line with the frame's number
    lines = read_lines(path)
    for number, text in enumerate(lines, 1):
        words = text.partition("#")[0].split()
        if not words:
            continue
        name = words[0]
        if name[0] == ":":
            angle_unit = {":degrees": np.pi / 180.0, ":radians": 1.0}.get(name.lower(), angle_unit)
        elif len(words) == 1 and name.isdecimal() and len(name) < 10:
            _check_frame(begin, row, skeleton, columns)
            if begin is not None and int(name) != int(begin.words[0]) + 1:
                raise Line(path, number, words).error(
                    f"frame {name} follows frame {begin.words[0]}: frames are missing or out of order. "
                    "Fetch the file again."
                )
            begin = Line(path, number, words)
            rows.append([None] * width)
            row = rows[-1]
        else:
            try:
                span = columns[name]
                if row is None or row[span] != [None] * (len(words) - 1) or "_" in "".join(words[1:]):
                    raise ValueError(text)
                row[span] = map(float, words[1:])
            except (KeyError, ValueError):
                raise _complaint(Line(path, number, words), row, skeleton, columns) from None
    _check_frame(begin, row, skeleton, columns)
    if not rows:
        raise FileFormatError(f"{path}: there is no frame in this file. Give a complete AMC file.")
    values = np.array(rows, dtype=np.float64)
    if not np.isfinite(values).all():
        _find_infinite(path, lines, columns)
    return values, angle_unit


def _check_frame(begin: Line | None, row: Row | None, skeleton: AcclaimSkeleton, columns: Columns) -> None:
    """Raises FileFormatError if a bone is missing from the frame that just ended."""
    if begin is not None and row is not None and None in row:
        missing = [name for name, span in columns.items() if None in row[span]]
        raise begin.error(
            f"frame {begin.words[0]} has no line for {listed(missing)}. The recording is cut short here (then remove "
            f"this frame) or belongs to another skeleton than {skeleton.source}."
        )


def _complaint(line: Line, row: Row | None, skeleton: AcclaimSkeleton, columns: Columns) -> FileFormatError:
    """What is wrong with a bone's line that could not be taken."""
    name = line.words[0]
    if name not in columns:
        return line.error(
            f"bone '{shortened(name)}' is not in the skeleton {skeleton.source} (it has: {listed(columns)}). "
            "Give the skeleton that belongs to this recording."
        )
    if row is None:
        return line.error("the number of a frame is expected before its first bone. Fetch the file again.")
    channels = skeleton.dof[list(columns).index(name)]
    if len(line.words) - 1 != len(channels):
        return line.error(
            f"bone '{shortened(name)}' has {len(channels)} channels ({' '.join(channels) or 'it is rigid'}), "
            f"but {len(line.words) - 1} values stand here. Fetch the file again, or give the skeleton it belongs to."
        )
    line.numbers(len(channels))
    return line.error(f"bone '{shortened(name)}' has a second line in this frame. Remove one of them.")


def _find_infinite(path: str | Path, lines: list[str], columns: Columns) -> None:
    """Raises FileFormatError for the first line with a number that is not finite."""
    for number, text in enumerate(lines, 1):
        words = text.partition("#")[0].split()
        if words and words[0] in columns:
            Line(path, number, words).numbers(len(words) - 1)
