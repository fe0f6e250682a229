"""Motions of Xsens MVN (.mvnx): XML with the position and orientation of every segment in every frame.

Each segment starts in the joint to its parent. Orientations are quaternions (w, x, y, z) relative to the T pose facing
x; z is up, y left, lengths are in m (MVN User Manual, "MVNX"). Points such as `pTopOfHead` are the ends of the last
segments. Sensors, joint angles and contacts are ignored.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

import numpy as np

from controller.motion.clip import AS_FOUND, Clip, Format, ReadingOptions
from controller.motion.joint_tree import MOST_POSES, JointTree, chosen_person, clip_of, free_name
from controller.motion.rotations import Array, normalise, rotate
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import shortened, what_it_is

MOST_SEGMENTS, MOST_SUBJECTS = 200, 100
FARTHEST = 1e5  # m
_POSES = ("identity", "tpose", "npose", "tpose-isb")  # frames that are no part of the motion


def read_mvnx(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The motion in an MVNX file."""
    people = _Contents(path).people
    moving = {name: one for name, one in people.items() if one.orientation or one.position}
    contents = next(iter((moving or people).values()), _Subject())
    if len(moving) > 1:
        contents = moving[chosen_person(path, moving, options.person)]
    try:
        rate = float(contents.rate)
    except ValueError:
        rate = 0.0
    if not 0.1 <= rate <= 1e5:
        raise FileFormatError(f"{path}: '{shortened(contents.rate or '')}' is no frame rate. Export it again.")
    if not contents.orientation:
        raise FileFormatError(f"{path}: there are no frames with orientations in it. Export them too.")
    if len(contents.position) != len(contents.orientation):
        raise FileFormatError(f"{path}: frames without positions. Choose both orientation and position on export.")
    turn, place = np.stack(contents.orientation), np.stack(contents.position)
    length = np.linalg.norm(turn, axis=-1)
    bad = ~((length > 0.5) & (length < 2.0)).all(axis=1) | ~(np.abs(place).max(axis=(1, 2)) < FARTHEST)
    if bad.any():
        raise FileFormatError(f"{path}: frame {int(np.argmax(bad))} holds what is no orientation or position.")
    return clip_of(_tree(path, contents, normalise(turn), place), rate, path, options, unit=1.0, up="z")


def _tree(path: str | Path, contents: _Subject, turn: Array, place: Array) -> JointTree:
    """The segments from the pelvis on, parents first, and the ends of the last ones."""
    names, parent = list(contents.points), {child: above for above, child in contents.joints}
    children: dict[str, list[str]] = {name: [] for name in names}
    for child, above in parent.items():
        if above not in children or child not in children:
            ends = f"from '{shortened(above)}' to '{shortened(child)}'"
            raise FileFormatError(f"{path}: a joint leads {ends}, no segments.")
        children[above].append(child)
    if not parent:
        raise FileFormatError(f"{path}: no <joints> connect its segments. Export it again with them.")
    tops = [name for name in names if name not in parent and children[name]]
    order = tops[:1]
    for name in order:  # grows as it goes: no segment can come twice, because each has one parent
        order += children[name]
    if len(tops) != 1 or not set(parent) <= set(order):
        raise FileFormatError(f"{path}: its joints do not connect all segments to one root. Export it again.")
    index = [names.index(name) for name in order]
    where, turned = [place[:, i] for i in index], [turn[:, i] for i in index]
    above = [-1 if name == tops[0] else order.index(parent[name]) for name in order]
    labels = list(order)
    for joint, name in enumerate(order):
        ends = [point for point in contents.points[name].values() if any(point)]
        if not children[name] and ends:
            labels.append(f"{name} end")
            above.append(joint)
            where.append(where[joint] + rotate(turned[joint], np.array(ends[0])))
            turned.append(turned[joint])
    turns = np.arange(len(labels)) < len(order)
    return JointTree(tuple(labels), np.array(above), np.stack(where, axis=1), np.stack(turned, axis=1), turns)


@dataclass
class _Subject:
    rate: str = ""
    points: dict[str, dict[str, list[float]]] = field(default_factory=dict[str, dict[str, list[float]]])  # by segment
    joints: list[tuple[str, str]] = field(default_factory=list[tuple[str, str]])  # parent and child segment
    orientation: list[Array] = field(default_factory=list[Array])  # of each frame
    position: list[Array] = field(default_factory=list[Array])


class _Contents:
    """The subjects of a file by name, parsed in one pass; entities and document types are refused."""

    def __init__(self, path: str | Path) -> None:
        self.people: dict[str, _Subject] = {}
        self._one = _Subject()
        self._poses = 0  # segments times frames of all subjects
        self._path = path
        self._text: list[str] | None = None
        self._segment = self._point = self._connector = ""
        self._frame_counts = False
        self._parser = expat.ParserCreate(namespace_separator=" ")
        self._parser.buffer_text = True
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters
        self._parser.StartDoctypeDeclHandler = self._refuse
        self._parser.EntityDeclHandler = self._refuse
        try:
            with Path(self._path).open("rb") as file:
                if found := what_it_is(self._path, file.read(1024)):
                    raise FileFormatError(f"{self._path}: {found}")
                file.seek(0)
                self._parser.ParseFile(file)
        except (OSError, ValueError, LookupError) as error:  # LookupError: an unknown encoding
            reason = getattr(error, "strerror", None) or str(error)
            raise FileFormatError(f"{self._path}: cannot be read ({reason}). Check the name.") from None
        except expat.ExpatError as error:
            reason = expat.ErrorString(error.code)
            raise self._error(f"this is no well-formed XML ({reason}). Fetch it again.") from None

    def _error(self, problem: str) -> FileFormatError:
        return FileFormatError(f"{self._path} line {self._parser.CurrentLineNumber}: {problem}")

    def _refuse(self, *_: object) -> None:
        raise self._error("document types and entities are not read. Remove the DOCTYPE.")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        match tag.rpartition(" ")[2]:
            case "subject":
                if len(self.people) >= MOST_SUBJECTS:
                    raise self._error("more subjects than one take has. Export it again.")
                self._one, self._segment = _Subject(attributes.get("frameRate", "")), ""
                self.people[free_name(attributes.get("label") or "subject", self.people)] = self._one
            case "segment":
                self._segment = attributes.get("label", "")
                if not self._segment or self._segment in self._one.points or len(self._one.points) >= MOST_SEGMENTS:
                    raise self._error(f"segment '{shortened(self._segment)}' has no unique name. Export it again.")
                self._one.points[self._segment] = {}
            case "point":
                self._point = attributes.get("label", "")
            case "frame":
                self._frame_counts = attributes.get("type", "normal") not in _POSES
            case "orientation" | "position" if self._frame_counts:
                self._text = []
            case "pos_b" | "pos_s" | "connector1" | "connector2":
                self._text = []
            case _:
                pass

    def _characters(self, text: str) -> None:
        if self._text is not None:
            self._text.append(text)

    def _end(self, tag: str) -> None:
        if self._text is None:
            return
        text, self._text = "".join(self._text), None
        match tag.rpartition(" ")[2]:
            case "pos_b" | "pos_s" if self._segment:
                self._one.points[self._segment][self._point] = self._numbers(text, 3).tolist()
            case "connector1":
                self._connector = text.strip().partition("/")[0]
            case "connector2":
                self._one.joints.append((self._connector, text.strip().partition("/")[0]))
            case "orientation":
                self._one.orientation.append(self._numbers(text, 4 * len(self._one.points)).reshape(-1, 4))
                self._poses += len(self._one.points)
                if self._poses > MOST_POSES:
                    raise self._error("more frames than fit into memory. Export a part of it.")
            case "position":
                self._one.position.append(self._numbers(text, 3 * len(self._one.points)).reshape(-1, 3))
            case _:
                pass

    def _numbers(self, text: str, count: int) -> Array:
        try:
            numbers = np.array([float(word) for word in text.split()])
        except ValueError:
            numbers = np.zeros(0)
        if count == 0 or len(numbers) != count or not np.isfinite(numbers).all():
            raise self._error(f"expected {count} numbers. Export the file again.")
        return numbers


FORMAT = Format(suffixes=(".mvnx",), read=read_mvnx)
