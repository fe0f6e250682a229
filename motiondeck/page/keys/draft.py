"""A motion that is being written for a rig: its keys, how it was before each change, its course, and its file."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from controller.deck.interfaces import JointLimits
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.clip import Plays
from controller.motion.encodings.joint_angles import angles_of
from controller.motion.formats.keyframes import Keyframes
from controller.motion.rotations import Array
from motiondeck.page.keys.key_sheet import KeySheet
from motiondeck_base.errors import FileFormatError, UnknownNameError
from motiondeck_base.files import write_file
from motiondeck_base.toml_file import read_toml
from sim.robots.robot import Robot

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
            if joint not in robot.joints:
                raise UnknownNameError(f"{file}: {UnknownNameError.among('joint of the rig', joint, robot.joints)}")
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
        course = limited_course(joints, self.wanted, clip.rate, self._robot.limits, loop=loop)
        self.course: Array = course[0]
        self.held: list[HeldBack] = course[1]


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
