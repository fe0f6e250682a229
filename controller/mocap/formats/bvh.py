"""BVH recordings (Biovision): a tree of joints with their offsets, then the channels of every joint, frame by frame.

A joint turns by its rotation channels in the order in which that joint lists them: the first is the outermost. Its
position channels, where it has any, replace its OFFSET in each frame, as Blender and MotionBuilder read them. The file
does not give its up axis nor its unit, and a body may be unable to stand in its zero pose: `rest_pose` finds out.
`joint_tree` makes the joints into bones.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.mocap.clip import Clip
from controller.mocap.formats.tree_clip import clip_of
from controller.mocap.joint_tree import JointTree
from controller.mocap.reading_options import AS_FOUND, ReadingOptions
from controller.rotations import Array, about, multiply, rotate
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import Line, as_float, read_lines, shortened

MOST_JOINTS = 1000  # without a bound a broken file could ask for any amount of memory
MOST_NUMBERS = 30_000_000  # of a recording: five hours of a body with fingers at 30 Hz fill the memory of a laptop
CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "xyz")
_AXES = dict(zip("xyz", np.eye(3), strict=True))


@dataclass
class Joint:
    """A joint as it stands in the file; an end site is a joint without channels."""

    name: str
    parent: int
    offset: list[float] | None = None
    channels: tuple[str, ...] = ()


def read_bvh(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The motion in a BVH file.

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
    return clip_of(_tree(joints, values), rate, path, options)


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
    if len(rows) * width > MOST_NUMBERS:
        raise counts[0].error(
            f"{len(rows)} frames of {width} channels are more than fit into memory. Cut the recording into pieces."
        )
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


def _tree(joints: list[Joint], values: Array) -> JointTree:
    """Plays the file's channels on its joints, all in the file's own axes and unit."""
    frames = len(values)
    rotation = np.empty((frames, len(joints), 4))
    position = np.empty((frames, len(joints), 3))
    column = 0
    for index, joint in enumerate(joints):
        local = np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1))
        place = np.tile(np.array(joint.offset), (frames, 1))
        for channel in joint.channels:
            if channel.endswith("rotation"):
                local = multiply(local, about(_AXES[channel[0]], np.radians(values[:, column])))
            else:
                place[:, "xyz".index(channel[0])] = values[:, column]
            column += 1
        if index == 0:
            position[:, index], rotation[:, index] = place, local
        else:
            above = rotation[:, joint.parent]
            position[:, index] = position[:, joint.parent] + rotate(above, place)
            rotation[:, index] = multiply(above, local)
    return JointTree(
        tuple(joint.name for joint in joints),
        np.array([joint.parent for joint in joints]),
        position,
        rotation,
        np.array([any(channel.endswith("rotation") for channel in joint.channels) for joint in joints]),
    )
