"""Takes that Motive (OptiTrack) exports as CSV: the bones of a skeleton, or markers.

    Format Version,1.23,Take Name,walk,...,Export Frame Rate,120.000000,...,Length Units,Meters,Coordinate Space,Global
    ,Type,Bone,Bone,Bone,Bone,Bone,Bone,Bone,...
    ,Name,eva:Hip,eva:Hip,...
    ,ID,...
    ,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,...
    Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,...

Where a skeleton has bones with quaternions in global coordinates, they are read; else the measured markers, else those
that Motive computes from bones (OptiTrack documentation, "Data Export: CSV"). A bone lies between its joint, which is
its position, and the joints below; which bone hangs on which follows from their names.
"""

import csv
from pathlib import Path

import numpy as np

from controller.motion.bone_names import named_parts
from controller.motion.clip import AS_FOUND, FARTHEST, UNITS, Clip, Format, Markers, ReadingOptions, bridged
from controller.motion.formats.tables import even_times, first_row, numbers
from controller.motion.joint_tree import MOST_POSES, JointTree, chosen_person, clip_of
from controller.motion.rotations import Array, continuous, normalise
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import Line, listed, read_lines, shortened

_UNITS = {"meters": 1.0, "centimeters": 0.01, "millimeters": 0.001, "inches": 0.0254, "feet": 0.3048, **UNITS}
_MARKERS = ("Marker", "Bone Marker", "Skeleton Marker")  # the first kind of which there is one
_HEAD_LINES = 20  # at most before the columns' names
_Columns = dict[tuple[str, str, str], list[int]]  # of x, y, z (and w), by kind, name and measure
# The part that each part hangs on, nearest first; parents before their children.
_HANGS_ON = {
    **{"pelvis": ("pelvis",), "hip": ("pelvis",), "trunk": ("trunk", "pelvis")},
    **{"neck": ("neck", "trunk"), "head": ("neck", "trunk")},
    **{"thigh": ("hip", "pelvis"), "shank": ("thigh",), "foot": ("shank",), "toes": ("foot",), "clavicle": ("trunk",)},
    **{"upper arm": ("clavicle", "trunk"), "forearm": ("upper arm",), "hand": ("forearm",)},
}


def read_motive(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip | Markers:
    """The skeleton, or the markers, of an exported take."""
    texts = [*read_lines(path)]
    about, kinds, names, measures, axes, first = _head(path, texts)
    unit = options.unit or _UNITS.get(about.get("Length Units", "").lower())
    if unit is None:
        found = shortened(about.get("Length Units", ""))
        raise FileFormatError(f"{path} line 1: the unit '{found}' is unknown. Give it with --unit.")
    rows = [(number, text + "," * (len(axes) - 1 - text.count(","))) for number, text in enumerate(texts, 1)][first:]
    rows = [(number, text) for number, text in rows if text.strip(", ")]
    table = numbers(path, rows, len(axes), ",", FARTHEST / unit)
    columns: _Columns = {}
    for column in range(2, len(axes)):
        columns.setdefault((kinds[column], names[column], measures[column]), []).append(column)
    bones = [name for kind, name, measure in columns if (kind, measure) == ("Bone", "Rotation")]
    rate, table = even_times(table[:, 1], table, [Line(path, number, []) for number, _ in rows])
    if bones and all(len(columns["Bone", name, "Rotation"]) == 4 for name in bones):
        return clip_of(_skeleton(path, about, table, columns, bones, options.person), rate, path, options, unit)
    kind = next((kind for kind in (*_MARKERS, "Bone") if any(key[0] == kind for key in columns)), None)
    tracks = {
        name: found
        for (of, name, measure), found in columns.items()
        if of == kind and measure == "Position" and not name.rpartition(":")[2].startswith("Unlabeled")
    }
    twice = next((name for name, found in tracks.items() if len(found) != 3), None)
    if twice is not None:
        raise FileFormatError(f"{path}: '{shortened(twice)}' has {len(tracks[twice])} columns, not x, y, z. Rename it.")
    if not tracks:
        raise FileFormatError(
            f"{path}: neither bones nor labelled markers are in it (it holds: {listed(dict.fromkeys(kinds[2:]))}). "
            "Export it again with Bones, or with Markers."
        )
    position = np.stack([table[:, found] for found in tracks.values()], axis=1) * unit
    position[np.isnan(position).any(axis=-1)] = np.nan
    labels = options.renamed(tuple(tracks), path)
    if np.isnan(position).all():
        raise FileFormatError(f"{path}: no marker was ever seen ({listed(labels)}). Give another take.")
    return Markers(labels, rate, position, options.up, Path(path).name)


def _head(path: str | Path, texts: list[str]) -> tuple[dict[str, str], list[str], list[str], list[str], list[str], int]:
    """What line 1 says, the rows Type, Name, measure and axis of the columns, and the index of the first frame."""
    try:
        cells = [[cell.strip() for cell in row] for row in csv.reader(texts[:_HEAD_LINES])]
    except csv.Error as error:
        raise FileFormatError(f"{path}: its header cannot be read ({error}). Export it again.") from None
    at = next((i for i, row in enumerate(cells) if row[:1] == ["Frame"] and row[1:2] and "Time" in row[1]), None)
    if at is None or not cells[0][:1] == ["Format Version"]:
        raise FileFormatError(f"{path}: no row 'Frame,Time (Seconds),...' is in it. Export it again with its header.")
    about = dict(zip(cells[0][::2], cells[0][1::2], strict=False))
    above = [row for row in cells[1:at] if any(row)]
    axes = cells[at]
    if len(above) < 3 or any(len(row) > len(axes) for row in above):
        raise FileFormatError(f"{path} line {at + 1}: rows Type, Name, Position have other columns. Export it again.")
    kinds, names, measures = (row + [""] * (len(axes) - len(row)) for row in (above[0], above[1], above[-1]))
    return about, kinds, names, measures, axes, at + 1


def _skeleton(
    path: str | Path, about: dict[str, str], table: Array, columns: _Columns, bones: list[str], person: str | None
) -> JointTree:
    if about.get("Coordinate Space", "Global") != "Global":
        raise FileFormatError(f"{path} line 1: bones are in local coordinates. Export it again with global ones.")
    people = list(dict.fromkeys(name.rpartition(":")[0] for name in bones))
    if len(people) > 1:
        own = chosen_person(path, people, person)
        bones = [name for name in bones if name.rpartition(":")[0] == own]
    parts = named_parts([name.rpartition(":")[2] for name in bones])
    known = [(name, part) for name, part in zip(bones, parts, strict=True) if part is not None]  # fingers are left out
    last: dict[tuple[str, str], int] = {}  # the joint of a part and side seen last
    joints: list[tuple[str, int, Array, Array]] = []
    for name, part in sorted(known, key=lambda one: [*_HANGS_ON].index(one[1].part)):
        above = (last.get((on, side)) for on in _HANGS_ON[part.part] for side in (part.side, "middle"))
        parent = next((joint for joint in above if joint is not None), -1)
        if parent < 0 and (joints or part.part != "pelvis"):
            raise FileFormatError(f"{path}: bone '{shortened(name)}' has no known parent. Export the take as .bvh.")
        last[part.part, part.side] = len(joints)
        place = _seen(table, columns.get(("Bone", name, "Position"), []), 3, path)
        turn = _seen(table, columns["Bone", name, "Rotation"], 4, path)
        joints.append((name.rpartition(":")[2], parent, place, normalise(turn[:, [3, 0, 1, 2]])))
    if len(joints) * len(table) > MOST_POSES or len(joints) < 2:
        raise FileFormatError(f"{path}: {len(table)} frames of {len(joints)} bones cannot be read. Export a part.")
    labels, parents, position, rotation = zip(*joints, strict=True)
    turns = np.ones(len(joints), dtype=np.bool_)
    return JointTree(labels, np.array(parents), np.stack(position, axis=1), np.stack(rotation, axis=1), turns)


def _seen(table: Array, columns: list[int], width: int, path: str | Path) -> Array:
    """The positions or rotations of a bone, bridged where they are missing."""
    track = table[:, columns]
    there = ~np.isnan(track).any(axis=-1)
    if len(columns) != width or not there.any():
        raise FileFormatError(
            f"{path}: a bone is never seen, or has no columns of its position and rotation. Export the take again."
        )
    track[there] = track[there] if width == 3 else continuous(track[there])
    track[~there] = np.nan
    return bridged(track)


FORMAT = Format(suffixes=(".csv",), read=read_motive, matches=lambda path: first_row(path)[:1] == ["Format Version"])
