"""Watches whether the robot does its motion: experts recognise the measured joints, and each joint has to follow.

One call a tick, at the same cost. Where the targets stand still (a pause, the end of a one-shot) there
is nothing to be recognized, and nothing is claimed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.learning.recognition.deck_recognizer import JointWatcher
from controller.learning.recognition.expert_bank import ExpertBank
from controller.learning.recognition.joint_following import FollowingWatch
from controller.learning.recognition.online_recognizer import MismatchWatch
from controller.motion.rotations import Array

PATIENCE = 0.5  # s
STILL = 0.02  # rad: no joint's targets of the last quarter second lie further apart
CALM = 3.0  # s without cause after which an alarm is over
MOST_ALARMS = 100


@dataclass(frozen=True)
class Alarm:
    """What was found.

    Attributes:
        at: s of the deck's time.
        commanded: the motion that should have been done.
        seen: the motion that the joints looked like most.
        joint: the joint that did not follow, or "" where the motion as a whole is another one.
        text: all this in a line.
    """

    at: float
    commanded: str
    seen: str
    joint: str
    text: str


class DeckWatch:
    """Watches J joints of a robot that plays a library.

    Args:
        bank: experts on these joints; see `deck_recognizer.teach_joints`.
        joints: their names, length J.
        rate: ticks a second, Hz.
        patience: how long the joints may look like another motion than the commanded one, s.

    Attributes:
        seen: the motion that the joints look like, or None while they stand still or nothing is known yet.
        confidence: how much smaller the best expert's error is than the second's, in [0, 1).
        alarms: the latest MOST_ALARMS.
        raised: how many there were.
        seen_after: of each switch that was seen, s from the first tick of the new motion until it was recognized.
    """

    def __init__(self, bank: ExpertBank, joints: Sequence[str], rate: float, patience: float = PATIENCE) -> None:
        self._joints = tuple(joints)
        self._period = 1.0 / rate
        self._watcher = JointWatcher(bank)
        self._recognizer = self._watcher.recognizer
        self._mismatch = MismatchWatch(self._recognizer, patience=patience)
        self._following = FollowingWatch(len(joints), rate)
        self._calm = np.full(len(joints) + 1, CALM)  # s since each joint, and at last the whole, gave cause
        self._on = np.zeros(len(joints) + 1, dtype=np.bool_)
        self._cause = np.zeros(len(joints) + 1, dtype=np.bool_)
        self._commanded: str | None = None
        self._since_command: float | None = None
        self._right = self._asked = 0
        self.seen: str | None = None
        self.confidence = 0.0
        self.alarms: deque[Alarm] = deque(maxlen=MOST_ALARMS)
        self.raised = 0
        self.seen_after: deque[float] = deque(maxlen=10_000)

    @property
    def mismatch(self) -> float:
        """For how long another motion has been seen, s."""
        return self._mismatch.mismatch

    @property
    def stuck(self) -> NDArray[np.bool_]:
        """Which joints do not follow, shape (J,); one is among them until it has followed for CALM seconds."""
        return self._on[:-1]

    @property
    def right(self) -> float | None:
        """The share of ticks, beyond a switch and its grace, in which the commanded motion was seen."""
        return self._right / self._asked if self._asked else None

    def update(self, targets: Array, measured: Array, commanded: str, *, settled: bool, at: float) -> Sequence[Alarm]:
        """Goes one tick on; the alarms that begin with it.

        Args:
            targets: of the joints, shape (J,), rad.
            measured: where they are, shape (J,), rad; NaN where that is not known.
            commanded: the motion that should be done now.
            settled: whether it is really being played, and no switch is under way.
            at: s of the deck's time.
        """
        watch = self._mismatch
        self._watcher.update(measured, self._period)
        cause = self._cause
        cause[:-1] = self._following.update(targets, measured)
        moving = self._following.moved.max() > STILL
        self.seen = self._recognizer.motion if moving else None
        self.confidence = self._recognizer.confidence if moving else 0.0
        cause[-1] = watch.update(commanded, settled and bool(moving), self._period)
        self._count(commanded, watch.counting)
        self._calm += self._period
        self._calm[cause] = 0.0
        np.logical_and(self._on, self._calm < CALM, out=self._on)
        if not cause.any() or self._on[cause].all():
            return ()
        begun = np.flatnonzero(cause & ~self._on)
        self._on[begun] = True
        alarms = [self._alarm(int(index), commanded, at) for index in begun]
        self.alarms.extend(alarms)
        self.raised += len(alarms)
        return alarms

    def _count(self, commanded: str, counting: bool) -> None:
        """Keeps the figures of the report."""
        if commanded != self._commanded:
            # The first motion was not switched to.
            self._since_command = None if self._commanded is None else 0.0
            self._commanded = commanded
        if self._since_command is not None:
            self._since_command += self._period
            if self.seen == commanded:
                self.seen_after.append(self._since_command)
                self._since_command = None
        if counting:
            self._asked += 1
            self._right += self.seen == commanded

    def _alarm(self, index: int, commanded: str, at: float) -> Alarm:
        seen = self.seen or ""
        if index < len(self._joints):
            joint = self._joints[index]
            off = self._following.off[index]
            where = f"is {off:.2f} rad from its target" if np.isfinite(off) else "is not measured any more"
            return Alarm(at, commanded, seen, joint, f"joint {joint} {where}: stuck, or unplugged?")
        like = f"looked like '{seen}' instead of" if self._recognizer.known else "not looked like"
        return Alarm(at, commanded, seen, "", f"the joints have {like} '{commanded}' for {self.mismatch:.1f} s")
