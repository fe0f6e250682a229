"""Acclaim recordings (AMC): the angles of the bones of an ASF skeleton.

A frame is a line with its number, then one line per bone: its name and the values of its channels, in the order of the
skeleton. The file has no rate; CMU and HDM05 recorded at 120 Hz.
"""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TypeAlias

import numpy as np

from controller.motion.clip import Clip, Format, ReadingOptions
from controller.motion.formats.acclaim.asf import AcclaimSkeleton, from_acclaim, read_asf, turned
from controller.motion.rotations import Array, conjugate, continuous, multiply
from controller.motion.up_axis import turned_up
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import Line, listed, read_lines, shortened

Columns: TypeAlias = dict[str, slice]  # the values of the root and of each bone in a frame
Row: TypeAlias = list[float | None]  # one frame; None where no line has come yet
LEAST_ANGLES = 20  # a moving body with this many turns at least one by more than 6.3 degrees
_ANGLE_UNITS = {":degrees": np.pi / 180.0, ":radians": 1.0}


def read_amc(path: str | Path, skeleton: AcclaimSkeleton, rate: float = 120.0) -> Clip:
    """The motion in an AMC file, of the skeleton that it was recorded with, at a rate in Hz."""
    names = ("root", *skeleton.skeleton.bones)
    ends = np.cumsum([0, *(len(channels) for channels in skeleton.dof)]).tolist()
    columns = {name: slice(*span) for name, span in zip(names, pairwise(ends), strict=True)}
    values, declared = _values(path, skeleton, columns)
    angle_unit = skeleton.angle_unit if declared is None else declared
    turning = [channel[0] == "r" for channels in skeleton.dof for channel in channels]
    _check_angles(path, np.abs(values[:, turning]), angle_unit, declared is not None)

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

    root = from_acclaim(place) + skeleton.root_position
    return Clip(Path(path).stem, skeleton.skeleton, rate, root, continuous(rotation), Path(path).name)


def _values(path: str | Path, skeleton: AcclaimSkeleton, columns: Columns) -> tuple[Array, float | None]:
    """The values in the file, shape (frames, channels), and the angle unit that it declares, rad."""
    width = sum(len(channels) for channels in skeleton.dof)
    declared: float | None = None
    rows: list[Row] = []
    row: Row | None = None
    begin: Line | None = None  # the line with the frame's number
    for number, text in enumerate(read_lines(path), 1):
        words = text.partition("#")[0].split()
        if not words or words[0].startswith(":"):
            declared = _ANGLE_UNITS.get(words[0].lower(), declared) if words else declared
            continue
        name = words[0]
        if len(words) == 1 and name.isdecimal() and len(name) < 10:
            _check_frame(begin, row, skeleton, columns)
            if begin is not None and int(name) != int(begin.words[0]) + 1:
                raise Line(path, number, words).error(
                    f"frame {name} follows frame {begin.words[0]}: frames are missing or out of order. Fetch it again."
                )
            begin = Line(path, number, words)
            rows.append([None] * width)
            row = rows[-1]
        else:
            try:
                span = columns[name]
                if row is None or row[span] != [None] * (len(words) - 1) or "_" in "".join(words[1:]):
                    raise ValueError(text)
                values = [*map(float, words[1:])]
                if not all(map(math.isfinite, values)):
                    raise ValueError(text)
                row[span] = values
            except (KeyError, ValueError):
                raise _complaint(Line(path, number, words), row, skeleton, columns) from None
    _check_frame(begin, row, skeleton, columns)
    if not rows:
        raise FileFormatError(f"{path}: there is no frame in this file. Give a complete AMC file.")
    return np.array(rows, dtype=np.float64), declared


def _check_angles(path: str | Path, size: Array, angle_unit: float, declared: bool) -> None:
    """Raises FileFormatError if moving angles of these sizes (T, n) are implausible for their unit."""
    turn = 2.0 * np.pi
    if size.shape[1] < LEAST_ANGLES or np.ptp(size, axis=0).max() == 0.0:
        return
    if angle_unit == 1.0 and np.percentile(size, 95.0) > turn:
        raise FileFormatError(
            f"{path}: angles up to {size.max():.0f} are no radians. Write ':DEGREES' before the first frame."
        )
    if angle_unit != 1.0 and not declared and size.max() < turn:
        raise FileFormatError(
            f"{path}: no angle is larger than {size.max():.1f}, so they may be radians, but neither this file nor "
            "its skeleton says so. Write ':RADIANS', or ':DEGREES', on a line before the first frame."
        )


def _check_frame(begin: Line | None, row: Row | None, skeleton: AcclaimSkeleton, columns: Columns) -> None:
    if begin is not None and row is not None and None in row:
        missing = [name for name, span in columns.items() if None in row[span]]
        raise begin.error(
            f"frame {begin.words[0]} has no line for {listed(missing)}. The recording is cut short here (then remove "
            f"this frame) or belongs to another skeleton than {skeleton.source}."
        )


def _complaint(line: Line, row: Row | None, skeleton: AcclaimSkeleton, columns: Columns) -> FileFormatError:
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


def skeleton_of(recording: Path, top: Path) -> Path | None:
    """The .asf file of an .amc recording, in its folder or one above it up to `top`; None if there is none or no need.

    It is the one whose name begins the recording's name, or else the only one in a folder.
    """
    if recording.suffix.lower() != ".amc":
        return None
    for folder in recording.parents:
        there = _skeletons(folder)
        named = [p for p in there if recording.stem.startswith(p.stem)]
        if named:
            return max(named, key=lambda p: len(p.stem))
        if len(there) == 1:
            return there[0]
        if folder == top:
            break
    return None


def read_acclaim(path: str | Path, options: ReadingOptions) -> Clip:
    """The motion in an AMC file, with the given skeleton or the one that `skeleton_of` finds."""
    recording = Path(path)
    if not options.skeleton and not recording.exists():
        raise FileFormatError.missing(path)
    asf = options.skeleton or skeleton_of(recording, recording.parent.parent)
    if asf is None:
        found = _skeletons(recording.parent)
        names = f"{len(found)} .asf files ({', '.join(other.name for other in found)})" if found else "no .asf files"
        raise FileFormatError(f"{path}: there are {names} beside it. Give the recording's own (--skeleton FILE.asf).")
    clip = read_amc(path, read_asf(asf, options.unit))
    bones = options.renamed(clip.skeleton.bones, path)
    clip = replace(clip, skeleton=replace(clip.skeleton, bones=bones))
    return clip if options.up is None else turned_up(clip, "y", options.up)


def _skeletons(folder: Path) -> list[Path]:
    try:
        return sorted(p for p in folder.iterdir() if p.suffix.lower() == ".asf")
    except OSError as error:
        raise FileFormatError(f"{folder}: cannot be read ({error.strerror or error}). Give the skeleton.") from None


FORMAT = Format(suffixes=(".amc",), read=read_acclaim)
