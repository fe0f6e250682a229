"""Detects, at constant cost, that the robot does not do what is commanded: by recognition, and by joints that lag."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.learning.recognition.deck_recognizer import JointWatcher
from controller.learning.recognition.experts import ExpertBank
from controller.learning.recognition.online_recognizer import MismatchWatch
from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError

PATIENCE = 0.5  # s
STILL = 0.02  # rad: largest range of a joint's targets in the last quarter second at rest
CALM = 3.0  # s without cause after which an alarm ends
MOST_ALARMS = 100

LAG = 0.25  # s: largest delay of a joint that follows
TOLERANCE = 0.1  # rad: largest error of one
# s of a larger error until detection; the count falls as fast as it rises. In slow walking an ankle moves for 0.1 s.
FOLLOWING_PATIENCE = 0.08


@dataclass(frozen=True)
class Alarm:
    """A joint that does not follow, or another motion than the commanded one."""

    at: float  # time of the deck, s
    commanded: str
    seen: str  # the recognized motion
    joint: str  # that does not follow, or "" for another motion
    text: str  # one line for the user


class FollowingWatch:
    """Detects joints that do not follow their targets, because they are jammed or unplugged, at constant cost.

    A joint that follows with a delay of up to LAG is always within the range of its targets of the last LAG
    seconds. Its error is the distance from that range: a delay adds nothing, a jam shows as soon as the target has
    moved away. The experts cannot detect it: they see the past of the stuck joint and soon expect it to stay
    (docs/recognition.md).
    """

    def __init__(self, joints: int, rate: float) -> None:
        if joints < 1 or not rate * LAG >= 1.0:
            raise MotiondeckError(f"watching {joints} joints at {rate:g} Hz over {LAG:g} s is not possible")
        self._period = 1.0 / rate
        self._targets = np.zeros((round(rate * LAG) + 1, joints))
        self._tick = 0
        self._late = np.zeros(joints)
        self._lowest, self._highest = np.zeros(joints), np.zeros(joints)
        self._bad = np.zeros(joints, dtype=np.bool_)
        self.off = np.zeros(joints)  # error of each joint, rad
        self.moved = np.zeros(joints)  # range of each joint's targets of the last LAG seconds, rad

    def update(self, targets: Array, measured: Array) -> NDArray[np.bool_]:
        """Processes targets and measured positions of a tick, shape (J,), rad; NaN counts as not following.

        Returns whether each joint does not follow, shape (J,), which the next call overwrites.
        """
        if self._tick == 0:
            self._targets[:] = targets
        self._targets[self._tick % len(self._targets)] = targets
        self._tick += 1
        lowest, highest, off, bad = self._lowest, self._highest, self.off, self._bad
        np.minimum.reduce(self._targets, axis=0, out=lowest)
        np.maximum.reduce(self._targets, axis=0, out=highest)
        np.subtract(highest, lowest, out=self.moved)
        lowest -= measured
        np.subtract(measured, highest, out=off)
        np.maximum(lowest, off, out=off)
        np.maximum(off, 0.0, out=off)
        np.copyto(off, np.inf, where=np.isnan(off, out=bad))
        np.greater(off, TOLERANCE, out=bad)
        self._late -= self._period
        self._late += 2.0 * self._period * bad
        np.clip(self._late, 0.0, 2.0 * FOLLOWING_PATIENCE, out=self._late)
        return np.greater(self._late, FOLLOWING_PATIENCE, out=bad)


class DeckWatch:
    """Monitors J joints of a robot that plays a library, by experts on them (see `deck_recognizer.teach_joints`).

    It gets ticks at `rate` Hz; another motion has to last `patience` seconds until an alarm.
    """

    def __init__(self, bank: ExpertBank, joints: Sequence[str], rate: float, patience: float = PATIENCE) -> None:
        self._joints = tuple(joints)
        self._period = 1.0 / rate
        self._watcher = JointWatcher(bank)
        self._recognizer = self._watcher.recognizer
        self._mismatch = MismatchWatch(self._recognizer, patience)
        self._following = FollowingWatch(len(joints), rate)
        self._calm = np.full(len(joints) + 1, CALM)  # s since the last cause, of each joint and of the motion
        self._on = np.zeros(len(joints) + 1, dtype=np.bool_)
        self._cause = np.zeros(len(joints) + 1, dtype=np.bool_)
        self._commanded: str | None = None
        self._since_command: float | None = None
        self._right = self._asked = 0
        self.seen: str | None = None  # the recognized motion, or None at rest or before the first verdict
        self.confidence = 0.0  # how sure that is, in [0, 1); 0 at rest
        self.alarms: deque[Alarm] = deque(maxlen=MOST_ALARMS)  # the latest; `raised` counts all
        self.raised = 0
        self.seen_after: deque[float] = deque(maxlen=10_000)  # s from the first tick of a motion to its recognition

    @property
    def mismatch(self) -> float:
        """Duration of another motion so far, s."""
        return self._mismatch.mismatch

    @property
    def stuck(self) -> NDArray[np.bool_]:
        """Whether each joint does not follow, shape (J,); reset after CALM seconds of following."""
        return self._on[:-1]

    @property
    def right(self) -> float | None:
        """The share of ticks, except switches and their grace, in which the commanded motion was recognized."""
        return self._right / self._asked if self._asked else None

    def update(self, targets: Array, measured: Array, commanded: str, *, settled: bool, at: float) -> Sequence[Alarm]:
        """Processes a tick `at` a time of the deck, s, and returns the alarms that begin with it.

        `targets` and `measured` are of the joints, shape (J,), rad, NaN if not measured; `settled` says whether the
        commanded motion is playing, and no switch is under way.
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
