"""BVH recordings (Biovision): a tree of joints with their offsets, then the channels of every joint, frame by frame.

A joint turns by its rotation channels in the order in which that joint lists them: the first is the outermost. Its
position channels, where it has any, replace its OFFSET, as Blender and MotionBuilder read them. The file does not
say which axis is up, nor what one unit is, nor whether a body can stand in its zero pose: `rest_pose` finds out.

A joint becomes the bone from itself to its children. Where these begin in different places there is one bone for each
of them, called after both joints ("Hips-LeftUpLeg"); children that begin where their parent does add no bone of their
own. What is above the first fork ("Reference", "Armature") carries the body and is no bone either.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from controller.mocap.clip import Clip
from controller.mocap.rest_pose import RecordedBody, stand
from controller.rotations import Array, about, continuous, multiply, rotate
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import Line, as_float, read_lines, shortened

MOST_JOINTS = 1000  # without a bound a broken file could ask for any amount of memory
COINCIDENT = 1e-4  # of the body's size: exporters write 0.000069 for joints that sit in one place
CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "xyz")
_AXES = dict(zip("xyz", np.eye(3), strict=True))


@dataclass
class Joint:
    """A joint as it stands in the file; an end site is a joint without channels."""

    name: str
    parent: int
    offset: list[float] | None = None
    channels: tuple[str, ...] = ()
    children: list[int] = field(default_factory=list)


def read_bvh(path: str | Path, unit: float | None = None) -> Clip:
    """The motion in a BVH file.

    Args:
        path: of the file.
        unit: what one of its lengths is, m; None takes the usual unit that makes the body most like a person's size.

    Raises:
        FileFormatError: naming file and line, if it cannot be read or does not follow the format.
    """
    lines = [Line(path, number, text.split()) for number, text in enumerate(read_lines(path), 1)]
    found = (index for index, line in enumerate(lines) if line.words and line.words[0].upper() == "MOTION")
    motion = next(found, None)
    if motion is None:
        raise FileFormatError(f"{path}: there is no MOTION section. The file is cut short: fetch it again.")
    joints = _hierarchy(path, lines[:motion])
    rate, values = _motion(path, lines[motion:], sum(len(joint.channels) for joint in joints))
    body = _body(path, joints, values)
    skeleton, position, rotation = stand(Path(path).stem, body, unit)
    return Clip(Path(path).stem, skeleton, rate, position, continuous(rotation), Path(path).name)


def _hierarchy(path: str | Path, lines: list[Line]) -> list[Joint]:
    """The joints, parents first."""
    joints: list[Joint] = []
    open_joints: list[int] = []
    awaited: Joint | None = None  # has been named, and its brace is to come
    for line in _one_brace_a_line(lines):
        key, *rest = line.words
        current = joints[open_joints[-1]] if open_joints else None
        match key.upper():
            case "HIERARCHY" if not joints:
                pass
            case "{" if awaited is not None:
                open_joints.append(len(joints) - 1)
                awaited = None
            case "}" if current is not None and awaited is None:
                if current.offset is None:
                    raise line.error(f"joint '{shortened(current.name)}' has no OFFSET. Add it.")
                open_joints.pop()
            case "ROOT" | "JOINT" | "END" if awaited is None:
                awaited = _named(line, joints, open_joints)
            case "OFFSET" if current is not None and current.offset is None:
                current.offset = line.numbers(3)
                if max(map(abs, current.offset)) > 1e6:
                    raise line.error("an offset of this size is not possible.")
            case "CHANNELS" if current is not None and not current.channels and rest:
                current.channels = _channels(line)
            case _:
                raise line.error(f"'{shortened(key)}' cannot stand here. Fetch the file again.")
    if open_joints or awaited or not joints:
        raise FileFormatError(f"{path}: the HIERARCHY is not closed before MOTION. Fetch the file again.")
    return joints


def _one_brace_a_line(lines: list[Line]) -> Iterator[Line]:
    """The lines that are not empty; braces are taken off the lines they share."""
    for line in lines:
        words: list[str] = []
        for word in re.findall(r"[{}]|[^\s{}]+", " ".join(line.words)):
            if word not in "{}":
                words.append(word)
                continue
            if words:
                yield Line(line.path, line.number, words)
            yield Line(line.path, line.number, [word])
            words = []
        if words:
            yield Line(line.path, line.number, words)


def _named(line: Line, joints: list[Joint], open_joints: list[int]) -> Joint:
    """Adds the joint that a ROOT, JOINT or End Site line begins."""
    kind, *words = line.words
    if (kind.upper() == "ROOT") == bool(joints):
        raise line.error("expected one ROOT, and every joint below it. Split a file with several bodies.")
    if joints and not open_joints:
        raise line.error("the root has ended before this joint. Fetch the file again.")
    if len(joints) >= MOST_JOINTS:
        raise line.error(f"more than {MOST_JOINTS} joints, which no body has. Is it the right file?")
    parent = open_joints[-1] if open_joints else -1
    name = " ".join(words)
    if kind.upper() == "END":
        name = f"{joints[parent].name} end"
    elif not name:
        raise line.error(f"{kind.upper()} has no name. Add one.")
    taken = {joint.name for joint in joints}
    joint = Joint(next(n for n in _numbered(name) if n not in taken), parent)
    if parent >= 0:
        joints[parent].children.append(len(joints))
    joints.append(joint)
    return joint


def _numbered(name: str) -> Iterator[str]:
    """The name itself, then the name with ever higher numbers."""
    yield name
    yield from (f"{name} {number}" for number in range(2, MOST_JOINTS + 3))


def _channels(line: Line) -> tuple[str, ...]:
    count, *names = line.words[1:]
    channels = tuple(name.lower() for name in names)
    for channel in channels:
        if channel not in CHANNELS:
            raise line.error(f"'{shortened(channel)}' is no channel; there may be: {', '.join(CHANNELS)}.")
    if not count.isdecimal() or int(count[:4]) != len(channels) or len(set(channels)) < len(channels):
        raise line.error(f"{shortened(count)} channels are announced, but {len(set(channels))} are named.")
    return channels


def _motion(path: str | Path, lines: list[Line], width: int) -> tuple[float, Array]:
    """The rate in Hz, and the values as they stand in the file, shape (frames, channels)."""
    heads = [index for index, line in enumerate(lines) if line.words[:1] and line.words[0].lower() == "frame"]
    counts = [line for line in lines[: 1 + max(heads, default=0)] if line.words and line.words[0].lower() == "frames:"]
    if not heads or not counts:
        raise FileFormatError(f"{path}: 'Frames:' or 'Frame Time:' is missing after MOTION. Fetch the file again.")
    time_line = lines[heads[0]]
    period = time_line.number_from(time_line.words[-1])
    if not 1e-5 <= period <= 100.0:
        raise time_line.error(f"a frame time of {period:g} s is not possible.")
    declared = counts[0].number_from(counts[0].words[-1])
    rows = [line for line in lines[heads[0] + 1 :] if line.words]
    try:
        numbers = [float(word) for line in rows for word in line.words]
    except ValueError:
        numbers = [float("nan")]
    if not np.isfinite(numbers).all() or any("_" in word for line in rows for word in line.words):
        for line in rows:
            for word in line.words:
                if as_float(word) is None or not np.isfinite(float(word)):
                    raise line.error(f"expected a number, found '{shortened(word)}'.")
    if width == 0 or not numbers or len(numbers) != declared * width:
        raise counts[0].error(
            f"{declared:g} frames of {width} channels are announced, but {len(numbers)} numbers follow. "
            "The file is cut short or not whole: fetch it again."
        )
    # 0.0083333 s means 120 Hz: the files write few digits.
    return round(1.0 / period, 2), np.array(numbers).reshape(-1, width)


def _body(path: str | Path, joints: list[Joint], values: Array) -> RecordedBody:
    """Turns joints into bones and plays the file's angles on them, all in the file's own axes and unit."""
    offset = np.array([joint.offset for joint in joints])
    frames = len(values)
    rotation = np.empty((frames, len(joints), 4))
    position = np.zeros((frames, 3))
    column = 0
    for index, joint in enumerate(joints):
        local = np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1))
        place = np.tile(offset[index], (frames, 1))
        for channel in joint.channels:
            if channel.endswith("rotation"):
                local = multiply(local, about(_AXES[channel[0]], np.radians(values[:, column])))
            else:
                place[:, "xyz".index(channel[0])] = values[:, column]
            column += 1
        if index == 0:
            position = place
        elif any(channel.endswith("position") for channel in joint.channels):
            offset[index] = np.median(place, axis=0)  # bones are rigid
        rotation[:, index] = local if index == 0 else multiply(rotation[:, joint.parent], local)

    size = float(np.ptp(_zero_pose(joints, offset), axis=0).max())
    if not 0.0 < size < 1e9 or np.abs(position).max() > 1e9:
        raise FileFormatError(f"{path}: no body has joints like these. Is it the right file?")
    apart = np.abs(offset).max(axis=1) > COINCIDENT * size
    root = 0
    while len(joints[root].children) == 1:
        child = joints[root].children[0]
        if not joints[child].children or _forks_nowhere(joints, child):
            break
        position = position + rotate(rotation[:, root], offset[child])
        root = child
    return _bones(joints, offset, apart, root, size, position, rotation)


def _zero_pose(joints: list[Joint], offset: Array) -> Array:
    place = offset.copy()
    for index, joint in enumerate(joints):
        place[index] = 0.0 if index == 0 else place[joint.parent] + offset[index]
    return place


def _forks_nowhere(joints: list[Joint], joint: int) -> bool:
    while len(joints[joint].children) == 1:
        joint = joints[joint].children[0]
    return not joints[joint].children


def _bones(
    joints: list[Joint], offset: Array, apart: Array, root: int, size: float, position: Array, rotation: Array
) -> RecordedBody:
    names: list[str] = []
    parents: list[int] = []
    vectors: list[Array] = []
    bearers = [root]
    waiting = [(root, -1)]  # a joint, and the bone that ends in it
    while waiting:
        index, above = waiting.pop()
        ways: list[tuple[Array, int]] = []  # where the joint's bones end, and which bones they are
        below: list[tuple[int, int]] = []
        distinct = _distinct([offset[c] for c in joints[index].children if apart[c]], COINCIDENT * size)
        for child in joints[index].children:
            bone = above
            if apart[child]:
                same = (b for way, b in ways if np.abs(way - offset[child]).max() <= COINCIDENT * size)
                bone = next(same, -2)
                if bone == -2:
                    bone = len(names)
                    ways.append((offset[child], bone))
                    names.append(joints[index].name if distinct == 1 else f"{joints[index].name}-{joints[child].name}")
                    parents.append(above)
                    vectors.append(offset[child])
                    bearers.append(index)
            below.append((child, bone))
        waiting.extend(reversed(below))
    return RecordedBody(
        tuple(names), np.array(parents), np.array(vectors).reshape(-1, 3), position, rotation[:, bearers]
    )


def _distinct(vectors: list[Array], tolerance: float) -> int:
    """How many of some vectors differ."""
    kept: list[Array] = []
    for vector in vectors:
        if all(np.abs(vector - other).max() > tolerance for other in kept):
            kept.append(vector)
    return len(kept)
