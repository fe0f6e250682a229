"""Detects, at constant cost, that the robot does not do what is commanded: by recognition, and by joints that lag.

Experts on the robot's joint angles, which do not flip here, are trained on the library that it plays.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller.deck.interfaces import Retargeter
from controller.deck.tracks.frame_player import FramePlayer
from controller.learning.recognition.experts import ExpertBank, ExpertRecipe, teach
from controller.learning.recognition.features import ANGLE_UNIT
from controller.learning.recognition.online_recognizer import FrameTimes, MismatchWatch, OnlineRecognizer
from controller.library.motion_library import MotionLibrary
from controller.motion.rotations import Array, Flags, Indices
from controller.motion.skeleton import Pose, walk_path
from motiondeck_base.errors import MotiondeckError

RATE = 30.0  # Hz
LOOPS = 2.0  # repetitions of a loop in the training
THRESHOLD = 0.3
MEMORY = 0.1  # s; a longer one detects a switch later and nothing better

# On one body single frames suffice; a reservoir that forgets fast settles sooner after a switch.
EXPERTS = ExpertRecipe(leak=1.0)

PATIENCE = 0.5  # s
STILL = 0.02  # rad: largest range of a joint's targets in the last quarter second at rest
CALM = 3.0  # s without cause after which an alarm ends
MOST_ALARMS = 100

LAG = 0.25  # s: largest delay of a joint that follows
TOLERANCE = 0.1  # rad: largest error of one
# s of a larger error until detection; the count falls as fast as it rises. In slow walking an ankle moves for 0.1 s.
FOLLOWING_PATIENCE = 0.08


def joint_motions(library: MotionLibrary, retarget: Retargeter, rate: float = RATE) -> dict[str, Array]:
    """The joint targets of each motion of a library as its network plays them, shape (T, J), rad, at a rate in Hz."""
    player = FramePlayer(library.network.twin(), library.info.rate)
    out: dict[str, Array] = {}
    for motion in library.info.motions:
        player.cue(motion.name)
        seconds = motion.frames / library.info.rate * (LOOPS if motion.plays == "loop" else 1.0)
        channels = np.array([player.step(1.0 / rate).copy() for _ in range(max(4, round(seconds * rate)))])
        pose = walk_path(library.encoding.decode(channels), 1.0 / rate)
        moments = zip(pose.root_position, pose.heading, pose.rotation, strict=True)
        offsets = library.offsets(motion.name)
        out[motion.name] = np.array([retarget(Pose(*moment, offsets=offsets)).copy() for moment in moments])
    return out


def unwind(joints: Array, balls: Indices) -> None:
    """Replaces rotation vectors v = angle axis of ball joints, with indices (N, 3), by sin(angle) axis, in place.

    The joints have the shape (..., J), rad. The result is smooth, and the same for all rotation vectors of a rotation,
    which are whole turns apart.
    """
    if len(balls):
        vectors = joints[..., balls]
        joints[..., balls] = vectors * np.sinc(np.linalg.norm(vectors, axis=-1, keepdims=True) / np.pi)


def teach_joints(motions: dict[str, Array]) -> ExpertBank:
    """Experts on joint positions (T, J), rad, ball joints unwound; MotiondeckError for fewer than two motions."""
    if len(motions) < 2:
        raise MotiondeckError("a library of one motion leaves nothing to recognize")
    return teach(EXPERTS, [joints / ANGLE_UNIT for joints in motions.values()], list(motions))


class JointWatcher:
    """Passes joints measured at any rate to `recognizer`, online at RATE, by experts of `teach_joints`."""

    def __init__(self, bank: ExpertBank) -> None:
        self.recognizer = OnlineRecognizer(bank, THRESHOLD, RATE, MEMORY)
        self._times = FrameTimes(RATE)
        self._before: Array | None = None
        self._frame = np.zeros(self.recognizer.channels)
        self._scaled = np.zeros(self.recognizer.channels)

    def update(self, joints: Array, dt: float) -> None:
        """Takes joints (J,), rad, dt >= 0 s after the last, interpolated linearly; skips not finite ones."""
        if not np.isfinite(joints).all():
            self.recognizer.skipped += 1
            return
        if self._before is None:
            self._before = np.array(joints, dtype=np.float64)
            self._take(self._before)
            return
        for share in self._times.due(dt):
            np.multiply(self._before, 1.0 - share, out=self._frame)
            np.multiply(joints, share, out=self._scaled)
            self._frame += self._scaled
            self._take(self._frame)
        self._before[:] = joints

    def _take(self, joints: Array) -> None:
        np.multiply(joints, 1.0 / ANGLE_UNIT, out=self._scaled)
        self.recognizer.update(self._scaled)


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

    def update(self, targets: Array, measured: Array) -> Flags:
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
    """Monitors J joints by experts (`teach_joints`), `rate` ticks a second; another motion for `patience` s alarms."""

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
    def stuck(self) -> Flags:
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
