"""Acclaim skeletons (ASF) of CMU and HDM05: the tree of bones and the axes of their angles.

The format (Acclaim Skeleton File Definition 1.10, M. Schafer 1995) gives all bones in one global frame, y up, x left,
z forward; ours is x forward, y left, z up, which is a cyclic exchange. With C the rotation of a bone's own axes and M
that of its recorded angles, the bone turns by C M C^-1 against its parent.

Lengths are multiplied by 1 / `length` to get inches. Rotations follow one another about fixed axes: those of a bone's
own axes in the order of the letters of `axis`, those of the recording in the order of its channels (`dof`, or `order`
for the root), as Vicon writes it.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from controller.motion.rotations import IDENTITY, Array, about, multiply
from controller.motion.skeleton import ROOT, Skeleton
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import Line, as_float, listed, read_lines, shortened

INCH = 0.0254  # m
LARGEST = 4 * 2**20  # bytes; CMU's skeletons have 8 kB
MOST_BONES = 1000  # a face and both hands need 100; without a bound a broken file could ask for any amount of memory
ROTATIONS = ("rx", "ry", "rz")
TRANSLATIONS = ("tx", "ty", "tz")

AXES = {"x": np.array([0.0, 1.0, 0.0]), "y": np.array([0.0, 0.0, 1.0]), "z": np.array([1.0, 0.0, 0.0])}
Fields: TypeAlias = dict[str, Line]


@dataclass(frozen=True, eq=False)
class AcclaimSkeleton:
    """A skeleton of B bones, and the units and channels of its recordings; lists begin with the root."""

    skeleton: Skeleton
    axis: Array  # orientation of the axes of each bone's angles in the rest pose, (1 + B, 4)
    dof: tuple[tuple[str, ...], ...]  # each bone's recorded channels in order, of rx, ry, rz (the root also tx, ty, tz)
    root_position: Array  # added to all recorded root positions, (3,), m
    length_unit: float  # m
    angle_unit: float  # rad
    source: str  # name of the file


def from_acclaim(vector: Array | list[float]) -> Array:
    """A vector (..., 3) of ASF's axes (x left, y up, z forward) in ours (x forward, y left, z up)."""
    return np.asarray(vector)[..., [2, 0, 1]]


def turned(turns: Iterable[tuple[str, Array | float]]) -> Array:
    """Quaternions (..., 4) of successive rotations about the fixed axes of ASF, x, y or z, by (...) rad."""
    q = IDENTITY
    for axis, angle in turns:
        q = multiply(about(AXES[axis], angle), q)
    return q


def read_asf(path: str | Path, unit: float | None = None) -> AcclaimSkeleton:
    """The skeleton in an ASF file; `unit` overrides its unit of length, m."""
    sections = _sections(path)
    for section in ("root", "bonedata", "hierarchy"):
        if section not in sections:
            raise FileFormatError(f"{path}: there is no :{section} section. Give a complete ASF file.")
    length_unit, angle_unit = _units(sections.get("units", []))
    length_unit = unit or length_unit
    root = _fields(sections["root"])
    bones = _bones(path, sections["bonedata"])
    parent = _parents(sections["hierarchy"], bones)
    names = _order(path, list(bones), parent)
    if "order" not in root:
        raise FileFormatError(f"{path}: the :root section has no 'order' line. Give a complete ASF file.")
    if "orientation" in root and any(root["orientation"].numbers(3)):
        # Programs disagree on whether it applies to fixed or to moving axes, and Vicon always writes zero.
        raise root["orientation"].error("a root orientation other than 0 0 0 is not supported. Export without it.")

    rest = np.array([_direction(_needed(path, name, bones[name], "direction")) for name in names])
    length = np.array([_length(_needed(path, name, bones[name], "length")) for name in names]) * length_unit
    index = {name: position for position, name in enumerate(names)}
    parents = np.array([index.get(parent[name], ROOT) for name in names])
    skeleton = Skeleton(Path(path).stem, tuple(names), parents, rest, length)
    dof = [_channels(root["order"], ROTATIONS + TRANSLATIONS)]
    dof += [_channels(bones[name]["dof"], ROTATIONS) if "dof" in bones[name] else () for name in names]
    axis = np.array([IDENTITY, *(_axis(bones[name].get("axis"), angle_unit) for name in names)])
    position = from_acclaim(root["position"].numbers(3) if "position" in root else np.zeros(3)) * length_unit
    return AcclaimSkeleton(skeleton, axis, tuple(dof), position, length_unit, angle_unit, Path(path).name)


def _sections(path: str | Path) -> dict[str, list[Line]]:
    """The lines of each section; words after a section's name are its first line."""
    sections: dict[str, list[Line]] = {}
    current: list[Line] = []
    for number, text in enumerate(read_lines(path, LARGEST), 1):
        words = text.partition("#")[0].translate(_AS_SPACE).split()
        if words and words[0].startswith(":"):
            current = sections.setdefault(words[0][1:].lower(), [])
            words = words[1:]
        if words:
            current.append(Line(path, number, words))
    return sections


_AS_SPACE = str.maketrans("(),", "   ")


def _fields(lines: list[Line]) -> Fields:
    """Lines by their first word; a line that begins with a number continues the one before (limits do)."""
    fields: Fields = {}
    last: Line | None = None
    for line in lines:
        if last is not None and as_float(line.words[0]) is not None:
            last.words.extend(line.words)
        else:
            last = fields[line.words[0].lower()] = line
    return fields


def _units(lines: list[Line]) -> tuple[float, float]:
    """The units of length, m, and of angles, rad."""
    fields = _fields(lines)
    length_unit, angle_unit = INCH, np.pi / 180.0
    if "length" in fields:
        (scale,) = fields["length"].numbers(1)
        if not 1e-9 < scale < 1e9:
            raise fields["length"].error(f"a length unit of {scale:g} is not possible; CMU's files have 0.45.")
        length_unit /= scale
    if "angle" in fields:
        unit = "".join(fields["angle"].words[1:2]).lower()
        if unit not in ("deg", "rad"):
            raise fields["angle"].error(f"unknown angle unit '{shortened(unit)}'. Write 'angle deg' or 'angle rad'.")
        angle_unit = 1.0 if unit == "rad" else angle_unit
    return length_unit, angle_unit


def _bones(path: str | Path, lines: list[Line]) -> dict[str, Fields]:
    bones: dict[str, Fields] = {}
    block: list[Line] | None = None
    for line in lines:
        word = line.words[0].lower()
        if word == "begin":
            if block is not None:
                raise line.error("a bone begins before the one above it has ended. Put 'end' between them.")
            block = []
        elif block is None:
            raise line.error(f"expected 'begin' of a bone, found '{shortened(word)}'.")
        elif word == "end":
            fields = _fields(block)
            block = None
            if "name" not in fields or len(fields["name"].words) < 2:
                raise line.error("the bone that ends here has no name. Add a 'name' line to it.")
            name = fields["name"].words[1]
            if name in bones or name == "root":
                raise fields["name"].error(f"there is already a bone called '{shortened(name)}'. Rename one of them.")
            bones[name] = fields
        else:
            block.append(line)
    if block is not None:
        raise FileFormatError(f"{path}: the last bone of :bonedata has no 'end'. The file is cut off: fetch it again.")
    if not 1 <= len(bones) <= MOST_BONES:
        raise FileFormatError(
            f"{path}: :bonedata holds {len(bones)} bones; 1 to {MOST_BONES} are possible. Give a complete ASF file."
        )
    return bones


def _parents(lines: list[Line], bones: dict[str, Fields]) -> dict[str, str]:
    parent: dict[str, str] = {}
    for line in lines:
        above, *below = line.words
        if not below and above.lower() in ("begin", "end"):
            continue
        for name in line.words:
            if name not in bones and name != "root":
                raise line.error(f"bone '{shortened(name)}' is not in :bonedata (it has: {listed(['root', *bones])}).")
        for name in below:
            if name == "root":
                raise line.error(f"the root cannot have the parent '{shortened(above)}'. Remove it there.")
            if name in parent:
                both = f"'{shortened(parent[name])}' and '{shortened(above)}'"
                raise line.error(f"bone '{shortened(name)}' has two parents, {both}. Remove one of them.")
            parent[name] = above
    return parent


def _order(path: str | Path, names: list[str], parent: dict[str, str]) -> list[str]:
    """The bones with each parent before its children, otherwise as in the file."""
    children: dict[str, list[str]] = {}
    for name in reversed(names):
        if name not in parent:
            raise FileFormatError(f"{path}: bone '{shortened(name)}' has no parent in :hierarchy. Add it there.")
        children.setdefault(parent[name], []).append(name)
    order: list[str] = []
    waiting = children.get("root", [])
    while waiting:
        order.append(waiting.pop())
        waiting.extend(children.get(order[-1], []))
    reached = set(order)
    for name in names:
        if name not in reached:
            raise FileFormatError(
                f"{path}: bone '{shortened(name)}' is its own ancestor, or below one that is. Correct the :hierarchy."
            )
    return order


def _needed(path: str | Path, bone: str, fields: Fields, key: str) -> Line:
    if key not in fields:
        raise FileFormatError(f"{path}: bone '{shortened(bone)}' has no '{key}' line. Add it.")
    return fields[key]


def _direction(line: Line) -> Array:
    vector = from_acclaim(line.numbers(3))
    norm = math.hypot(*vector)
    if not 1e-6 < norm < 1e6:
        raise line.error("a direction of this size is not possible; a unit vector is expected.")
    return vector / norm


def _length(line: Line) -> float:
    (length,) = line.numbers(1)
    if not 0.0 <= length < 1e6:
        raise line.error(f"a bone cannot be {length:g} long.")
    return length


def _axis(line: Line | None, angle_unit: float) -> Array:
    """The rotation C of a bone, from angles about x, y, z and the order in which they turn: 'axis 0 0 20 XYZ'."""
    if line is None:
        return IDENTITY
    angle = dict(zip("xyz", line.numbers(3), strict=True))
    letters = "".join(line.words[4:5]).lower()
    if sorted(letters) != ["x", "y", "z"]:
        raise line.error(f"expected the order of the axes, such as XYZ, found '{shortened(letters)}'.")
    return turned((letter, angle[letter] * angle_unit) for letter in letters)


def _channels(line: Line, known: tuple[str, ...]) -> tuple[str, ...]:
    channels = tuple(word.lower() for word in line.words[1:])
    for channel in channels:
        if channel not in known:
            raise line.error(f"'{shortened(channel)}' is not supported here; there may be: {', '.join(known)}.")
    if len(set(channels)) < len(channels):
        raise line.error("a channel is named twice. Remove one of them.")
    return channels
