"""BVH recordings (Biovision): a tree of joints with their offsets, then the channels of every joint, frame by frame.

A joint rotates by its rotation channels in the order in which that joint lists them: the first is the outermost. Its
position channels, if any, replace its OFFSET in each frame, as in Blender and MotionBuilder; channels that begin at
zero though the OFFSET does not are added to it. The file gives neither its up axis nor its unit, and its zero pose may
be arbitrary: `rest_pose` detects them. `joint_tree` turns the joints into bones.
"""

import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from controller.motion.clip import AS_FOUND, Clip, Format, ReadingOptions
from controller.motion.joint_tree import MOST_POSES, JointTree, clip_of, free_name, one_body, played
from controller.motion.rotations import Array, about, multiply
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import Line, read_text, shortened

MOST_JOINTS = 1000  # without a bound a broken file could ask for any amount of memory
LONGEST_PERIOD = 1.0  # s; a longer frame time is a rate written in its place
USUAL_RATES = (24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 90.0, 100.0, 120.0, 200.0, 240.0)  # Hz
# Position channels nearer to zero than this, in lengths of the OFFSET, are relative to it; in the next two frames too.
AT_ZERO, NEAR_ZERO = 0.02, 0.15
CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "xyz")
_AXES = dict(zip("xyz", np.eye(3), strict=True))


@dataclass
class Joint:
    """A joint of the file; an end site is a joint without channels."""

    name: str  # unique within its ROOT
    parent: int
    offset: list[float] | None = None
    channels: tuple[str, ...] = ()


def read_bvh(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The motion in a BVH file."""
    text = read_text(path)
    time = re.search(r"^[ \t]*frame[ \t]+time[ \t]*:[^\n]*$", text, re.MULTILINE | re.IGNORECASE)
    end = len(text) if time is None else time.end()
    head, rows, at = text[:end], text[end:], text.count("\n", 0, end)
    lines = [Line(path, number, text.split()) for number, text in enumerate(head.split("\n"), 1)]
    found = (index for index, line in enumerate(lines) if line.words and line.words[0].upper() == "MOTION")
    motion = next(found, None)
    if not any(line.words and line.words[0].upper() == "HIERARCHY" for line in lines[: motion or None]):
        raise FileFormatError(f"{path}: this is no BVH file: there is no HIERARCHY section. Is it the right file?")
    if motion is None:
        raise FileFormatError(f"{path}: there is no MOTION section. The file is cut short: fetch it again.")
    joints = _hierarchy(path, lines[:motion])
    width = sum(len(joint.channels) for joint in joints)
    rate, announced = _frame_header(path, lines[motion:])
    lines_left = rows.count("\n")
    if lines_left * len(joints) > MOST_POSES:
        raise announced.error(f"{lines_left} frames of {len(joints)} joints do not fit into memory. Cut the recording.")
    tree, decisions = one_body(_tree(joints, _values(rows, at, width, announced)), path, options.person)
    clip = clip_of(tree, rate, path, options)
    return replace(clip, decisions=(*decisions, *clip.decisions))


def _hierarchy(path: str | Path, lines: list[Line]) -> list[Joint]:
    joints: list[Joint] = []
    open_joints: list[int] = []
    awaited: Joint | None = None  # named, its brace not read yet
    for line in _whole(_one_brace_a_line(lines)):
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


def _whole(lines: Iterator[Line]) -> list[Line]:
    """The lines, with channels that are wrapped over several on one."""
    whole: list[Line] = []
    for line in lines:
        before = whole[-1].words if whole else [""]
        if before[0].upper() == "CHANNELS" and (len(before) == 1 or line.words[0].lower() in CHANNELS):
            before += line.words
        else:
            whole.append(line)
    return whole


def _one_brace_a_line(lines: list[Line]) -> Iterator[Line]:
    """The lines that are neither empty nor comments, each brace on a line by itself."""
    for line in lines:
        if line.words and line.words[0].startswith(("#", "//")):
            continue
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
    kind, *words = line.words
    if (kind.upper() == "ROOT") == bool(open_joints):
        raise line.error("expected a ROOT outside of all joints, and each other joint within one. Fetch it again.")
    if len(joints) >= MOST_JOINTS:
        raise line.error(f"more than {MOST_JOINTS} joints, which no body has. Is it the right file?")
    parent = open_joints[-1] if open_joints else -1
    name = " ".join(words)
    if kind.upper() == "END":
        name = f"{joints[parent].name} end"
    elif not name:
        raise line.error(f"{kind.upper()} has no name. Add one.")
    same_body = joints[open_joints[0] :] if open_joints else []
    joints.append(Joint(free_name(name, {joint.name for joint in same_body}), parent))
    return joints[-1]


def _channels(line: Line) -> tuple[str, ...]:
    count, *names = line.words[1:]
    channels = tuple(name.lower() for name in names)
    for channel in channels:
        if channel not in CHANNELS:
            raise line.error(f"'{shortened(channel)}' is no channel; there may be: {', '.join(CHANNELS)}.")
    if not count.isdecimal() or int(count[:4]) != len(channels) or len(set(channels)) < len(channels):
        raise line.error(f"{shortened(count)} channels are announced, but {len(set(channels))} are named.")
    return channels


def _frame_header(path: str | Path, lines: list[Line]) -> tuple[float, Line]:
    """The rate in Hz, and the line with the number of frames, from the two lines after MOTION."""
    headers = [Line(path, line.number, " ".join(line.words).replace(":", " : ").split()) for line in lines]
    times = [line for line in headers if [word.lower() for word in line.words[:2]] == ["frame", "time"]]
    counts = [line for line in headers if [word.lower() for word in line.words[:2]] == ["frames", ":"]]
    if not times or not counts:
        raise FileFormatError(f"{path}: 'Frames:' or 'Frame Time:' is missing after MOTION. Fetch the file again.")
    period = times[0].number_from(times[0].words[-1])
    if not 1e-5 <= period <= LONGEST_PERIOD:
        rate = f" For {period:g} frames a second write {1.0 / period:.6f}." if period > LONGEST_PERIOD else ""
        raise times[0].error(f"a frame time of {period:g} s is not possible; it is seconds from frame to frame.{rate}")
    return _rate(period, times[0].words[-1]), counts[0]


def _rate(period: float, written: str) -> float:
    """The rate, Hz, of a frame time, s, which files round: 0.0083 s is 120 Hz, and 0.033 s is 30 Hz."""
    exact = round(1.0 / period, 2)
    rounded = 0.5 * 10.0 ** int(Decimal(written).as_tuple().exponent)
    meant = (rate for rate in USUAL_RATES if abs(1.0 / rate - period) <= rounded)
    return exact if exact == round(exact) else next(meant, exact)


def _values(rows: str, at: int, width: int, announced: Line) -> Array:
    """The values, shape (frames, channels), also of unannounced frames: some exporters count one too few."""
    frames = announced.number_from(announced.words[-1])
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # of numpy where a word is not a number
        try:
            numbers = np.fromstring(rows, sep=" ") if rows.strip() else np.zeros(0)
        except (DeprecationWarning, ValueError):
            numbers = np.array([np.nan])
    if not np.isfinite(numbers).all():
        for number, row in enumerate(rows.split("\n"), at + 1):
            for word in row.split():
                Line(announced.path, number, []).number_from(word)  # names the first that is none
        raise FileFormatError(f"{announced.path}: a number cannot be read. Fetch the file again.")
    if width == 0 or len(numbers) == 0 or len(numbers) % width or len(numbers) < frames * width:
        raise announced.error(_frame_problem(rows, at, frames, width, len(numbers)))
    return numbers.reshape(-1, width)


def _frame_problem(rows: str, at: int, frames: float, width: int, count: int) -> str:
    """The error in the frames: their number, or the first row of another length."""
    again = "The file is cut short or not whole: fetch it again."
    if not count:
        return "no frames follow. Export the motion again."
    if width and not count % width:
        follow = count // width
        announced = f"{frames:g} frames are announced, but {follow} follow."
        return f"{announced} Fetch the file again, or write 'Frames: {follow}'."
    for number, row in enumerate(rows.split("\n"), at + 1):
        if 0 < (here := len(row.split())) != width:
            return f"a frame has {width} channels, but line {number} has {here} numbers. {again}"
    return f"frames of {width} channels are announced, but {count} numbers follow. {again}"


def _added(place: Array, joint: Joint) -> bool:
    """Whether position channels (T, 3) are relative to the OFFSET: in the first frames of a root, or the median."""
    if sum(channel.endswith("position") for channel in joint.channels) < 3:
        return False
    away = np.linalg.norm(place, axis=1) / max(float(np.linalg.norm(np.array(joint.offset))), 1e-9)
    if joint.parent >= 0:
        return bool(np.median(away) < AT_ZERO)
    return bool(away[0] < AT_ZERO and np.median(away[:3]) < NEAR_ZERO)


def _tree(joints: list[Joint], values: Array) -> JointTree:
    frames = len(values)
    turn = np.empty((frames, len(joints), 4))
    place = np.empty((frames, len(joints), 3))
    column = 0
    for index, joint in enumerate(joints):
        local = np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1))
        place[:, index] = np.array(joint.offset)
        for channel in joint.channels:
            if channel.endswith("rotation"):
                local = multiply(local, about(_AXES[channel[0]], np.radians(values[:, column])))
            else:
                place[:, index, "xyz".index(channel[0])] = values[:, column]
            column += 1
        if _added(place[:, index], joint):
            place[:, index] += np.array(joint.offset)
        turn[:, index] = local
    turns = np.array([any(channel.endswith("rotation") for channel in joint.channels) for joint in joints])
    return played([joint.name for joint in joints], [joint.parent for joint in joints], place, turn, turns)


FORMAT = Format(suffixes=(".bvh",), read=read_bvh, magic=b"HIERARCHY")
