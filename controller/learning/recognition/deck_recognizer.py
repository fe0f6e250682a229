"""Recognition on a robot: experts on its joint angles, which do not flip here, trained on the library it plays."""

import numpy as np
from numpy.typing import NDArray

from controller.deck.interfaces import Retargeter
from controller.deck.tracks.frame_player import FramePlayer
from controller.learning.recognition.experts import ExpertBank, ExpertRecipe, teach
from controller.learning.recognition.features import ANGLE_UNIT
from controller.learning.recognition.online_recognizer import FrameTimes, OnlineRecognizer
from controller.library.motion_library import MotionLibrary
from controller.motion.posture import Pose, walk_path
from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError

RATE = 30.0  # Hz
LOOPS = 2.0  # repetitions of a loop in the training
THRESHOLD = 0.3
MEMORY = 0.1  # s; a longer one detects a switch later and nothing better

# On one body single frames suffice; a reservoir that forgets fast settles sooner after a switch.
EXPERTS = ExpertRecipe(leak=1.0)


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
        out[motion.name] = np.array([retarget(Pose(*moment)).copy() for moment in moments])
    return out


def unwind(joints: Array, balls: NDArray[np.int64]) -> None:
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
    signals = [joints / ANGLE_UNIT for joints in motions.values()]
    return teach(EXPERTS, signals, list(motions))


class JointWatcher:
    """Passes joints measured at any rate to `recognizer`, online at RATE, by experts of `teach_joints`."""

    def __init__(self, bank: ExpertBank) -> None:
        self.recognizer = OnlineRecognizer(bank, THRESHOLD, RATE, MEMORY)
        self._times = FrameTimes(RATE)
        self._before: Array | None = None
        self._frame = np.zeros(self.recognizer.channels)
        self._scaled = np.zeros(self.recognizer.channels)

    def update(self, joints: Array, dt: float) -> None:
        """Processes joints (J,), rad, measured dt >= 0 seconds after the last ones.

        Frames are interpolated linearly. A measurement that is not finite is skipped with its time.
        """
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
