"""A motion that is being written for a rig: its keys, how it was before each change, its course, and its file."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from controller.deck.interfaces import JointLimits
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.clip import Clip, Plays
from controller.motion.encodings.joint_angles import angles_of
from controller.motion.formats.keyframes import Easing, Key, Keyframes, drawn_up
from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError, UnknownNameError
from motiondeck_base.files import write_file
from motiondeck_base.toml_file import read_toml, toml_key
from sim.robots.robot import Robot

Way = tuple[float, Easing]
_TO_MS, _TO_DEG = 3, 4  # decimals of a time, s, and of an angle, deg


@dataclass
class KeySheet:
    """Keys by their times, s: where each joint is, deg, and how it comes there."""

    plays: Plays
    length: float  # s
    keys: dict[float, dict[str, Way]] = field(default_factory=dict[float, dict[str, Way]])
    rate: float = 100.0  # Hz, at which it is drawn up

    @classmethod
    def of(cls, written: Keyframes) -> "KeySheet":
        """The sheet of a file; its `rest` is a key at 0 s."""
        unit = math.degrees if written.unit == "rad" else float
        length = written.length or max((key.at for key in written.key), default=1.0)
        sheet = cls(written.plays, length, rate=written.rate)
        for key in written.key:
            sheet.set(key.at, {joint: unit(value) for joint, value in key.values.items()}, key.easing)
        first = sheet.keys.get(0.0, {})
        sheet.set(0.0, {joint: unit(value) for joint, value in written.rest.items() if joint not in first})
        return sheet

    def copy(self) -> "KeySheet":
        """A sheet that goes its own way."""
        return replace(self, keys={at: dict(key) for at, key in self.keys.items()})

    def set(self, at: float, pose: Mapping[str, float], easing: Easing = "smooth") -> float:
        """Sets joints, deg, at a time, s, which is returned: the end of a loop is its beginning."""
        at = round(at, _TO_MS) + 0.0
        at = 0.0 if self.plays == "loop" and at == round(self.length, _TO_MS) else at
        if pose:
            key: dict[str, Way] = {joint: (round(value, _TO_DEG), easing) for joint, value in pose.items()}
            self.keys = dict(sorted((self.keys | {at: self.keys.get(at, {}) | key}).items()))
        return at

    def delete(self, at: float) -> None:
        """Deletes the key at a time, s, if there is one."""
        self.keys.pop(at, None)

    def move(self, at: float, to: float) -> float:
        """Moves a key; where it meets another, its joints win. The time at which it is then, s."""
        for joint, (value, easing) in self.keys.pop(at, {}).items():
            at = self.set(to, {joint: value}, easing)
        return at

    @property
    def written(self) -> Keyframes:
        """The same as a file has it: a row for each time and easing."""
        rows: list[Key] = []
        for at, key in self.keys.items():
            ways: list[Easing] = [way for _, way in key.values()]
            for easing in dict.fromkeys(ways):
                pose = {joint: value for joint, (value, way) in key.items() if way == easing}
                rows.append(Key(at, pose=pose, easing=easing))
        return Keyframes(rows, "deg", self.plays, self.length, rate=self.rate)

    @property
    def text(self) -> str:
        """The contents of its file."""
        rate = f"rate = {self.rate}\n" if self.rate != 100.0 else ""
        lines = [f'unit = "deg"\nplays = "{self.plays}"\nlength = {self.length}\n{rate}key = [']
        for key in self.written.key:
            pose = ", ".join(f"{toml_key(joint)} = {value}" for joint, value in key.pose.items())
            easing = f', easing = "{key.easing}"' if key.easing != "smooth" else ""
            lines.append(f"  {{ at = {key.at}, pose = {{ {pose} }}{easing} }},")
        return "\n".join([*lines, "]\n"])

    def clip(self, name: str) -> Clip:
        """The motion; FileFormatError if the keys contradict each other, or there is none."""
        return drawn_up(self.written, name)


NEW_SECONDS = 4.0
_UNDONE = 200  # changes that can be undone
_NOTED = np.radians(0.5)  # of what is held back

# From when to when, s, a joint is held back, and in words which one, by how much, and by which limit.
HeldBack = tuple[float, float, str]


class Draft:
    """The keys of a file, or of a new one, for J joints; after each change the course is up to date."""

    def __init__(self, file: Path, robot: Robot, plays: Plays = "once") -> None:
        """Reads the file, if there is one; FileFormatError or UnknownNameError if it does not fit the rig."""
        self.file, self._robot = file, robot
        self._before: list[KeySheet] = []
        self._on_disk = self._saved = None
        self.sheet = KeySheet(plays, NEW_SECONDS)
        rest = np.round(np.degrees(robot.rest), 1)
        self.rest: dict[str, float] = dict(zip(robot.joints, rest.tolist(), strict=True))
        if file.exists():
            self.sheet = KeySheet.of(read_toml(file, Keyframes))
            self._saved = self.sheet.text
        else:
            self.sheet.set(0.0, self.rest)
        for joint in (joint for key in self.sheet.keys.values() for joint in key):
            UnknownNameError.check("joint of the rig", joint, robot.joints, f"{file}: ")
        self._draw()

    @property
    def rate(self) -> float:
        """Frames of the course per second, Hz."""
        return (len(self.course) - 1) / self.sheet.length

    @property
    def unsaved(self) -> bool:
        """Whether the file does not hold these keys."""
        return self._saved != self.sheet.text

    def change(self, edit: Callable[[KeySheet], object]) -> None:
        """Changes the keys; FileFormatError if they contradict each other then, and all stays as it was."""
        before = self.sheet
        self.sheet = before.copy()
        try:
            edit(self.sheet)
            self._draw()
        except FileFormatError:
            self.sheet = before
            raise
        if self.sheet != before:
            self._before = [*self._before, before][-_UNDONE:]

    def undo(self) -> None:
        """Takes the last change back, if there is one."""
        if self._before:
            self.sheet = self._before.pop()
            self._draw()

    def pose(self, seconds: float) -> dict[str, float]:
        """Where the keys want the joints at a time, s; deg."""
        frame = min(round(seconds * self.rate), len(self.wanted) - 1)
        return dict(zip(self._robot.joints, np.degrees(self.wanted[frame]).tolist(), strict=True))

    def save(self) -> str:
        """Writes the file, and says so; another content that it had is kept beside it. FileFormatError if it cannot."""
        text = self.sheet.text.encode()
        before, kept = self.file.read_bytes() if self.file.exists() else None, ""
        if before is not None and before not in (text, self._on_disk):
            beside = self.file.with_name(self.file.name + ".bak")
            write_file(beside, before)
            kept = f"; what it held before is in {beside.name}"
        write_file(self.file, text)
        self._on_disk, self._saved = text, self.sheet.text
        return f"saved as {self.file}{kept}"

    def _draw(self) -> None:
        """Finds where the joints shall be, `wanted`, shape (T, J), rad, and the course that limits leave of it."""
        clip, joints = self.sheet.clip(self.file.stem), self._robot.joints
        self.wanted: Array = np.tile(self._robot.rest, (len(clip), 1))
        self.wanted[:, [joints.index(bone) for bone in clip.skeleton.bones]] = angles_of(clip.rotation[:, 1:])
        loop = self.sheet.plays == "loop"
        self.course, self.held = limited_course(joints, self.wanted, clip.rate, self._robot.limits, loop=loop)


def limited_course(
    joints: Sequence[str], wanted: Array, rate: float, limits: JointLimits, *, loop: bool
) -> tuple[Array, list[HeldBack]]:
    """Where joints go, shape (T, J), rad, that shall go as `wanted` (T, J), at a rate, Hz; a loop in its second round.

    What is within the limits comes out as it is.
    """
    envelope = SafetyEnvelope(limits, 1.0 / rate)
    envelope.start(np.clip(wanted[0], limits.lower, limits.upper))
    rounds = [np.array([envelope(targets).copy() for targets in wanted[begin:]]) for begin in ([0, 1] if loop else [0])]
    course = np.concatenate([rounds[0][-1:], rounds[1]]) if loop else rounds[0]
    off = np.abs(course - wanted)
    speed = np.abs(np.gradient(wanted, 1.0 / rate, axis=0))
    found: list[HeldBack] = []
    for index in np.flatnonzero(off.max(axis=0) > _NOTED).tolist():
        at = np.flatnonzero(off[:, index] > _NOTED)
        here, values, fastest = off[:, index], wanted[:, index], speed[:, index].max()
        low, high, allowed = limits.lower[index], limits.upper[index], limits.velocity[index]
        if values.min() < low - _NOTED or values.max() > high + _NOTED:
            ends = np.degrees((values.min(), values.max(), low, high))
            why = "it goes from {:.0f} to {:.0f}°, and may {:.0f} to {:.0f}°".format(*ends)
        elif fastest > allowed:
            why = f"it turns at {np.degrees(fastest):.0f}°/s, and may {np.degrees(allowed):.0f}°/s"
        else:
            why = "it speeds up faster than it may"
        text = f"{joints[index]} is held back by up to {np.degrees(here.max()):.1f}°: {why}"
        found.append((float(at[0] / rate), float(at[-1] / rate), text))
    return course, found
