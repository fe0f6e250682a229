"""Online recognition of a body from poses at any rate, by a saved recognizer."""

import numpy as np

from controller.learning.recognition.features import POSITION_UNIT, VELOCITY_UNIT, still_features
from controller.learning.recognition.online_recognizer import FrameTimes, OnlineRecognizer
from controller.learning.recognition.recognizer import Recognizer
from controller.motion.clip import Clip
from controller.motion.rotations import Array
from controller.motion.skeleton import Skeleton

STEADY = 0.06  # s for which a verdict must be constant before it is reported


class BodyRecognizer:
    """Recognizes the motion of a body of B bones with a recognizer trained on recordings of any bodies.

    `online` has the verdict of the last frame, and `seen` the motion that has been the verdict for STEADY seconds, or
    None. MotiondeckError if the skeleton lacks a joint of the recognizer's features.
    """

    def __init__(self, recognizer: Recognizer, skeleton: Skeleton) -> None:
        self._recipe, self._skeleton = recognizer.recipe, skeleton
        self.online = OnlineRecognizer(recognizer.bank, recognizer.threshold, recognizer.recipe.rate)
        self._times = FrameTimes(recognizer.recipe.rate)
        self._frame: Array | None = None
        self._root, self._rotation = np.zeros((2, 3)), np.zeros((2, 1 + len(skeleton), 4))
        self._rotation[..., 0] = 1.0
        self._still()  # names a joint that is missing, before anything moves
        self._begun = False
        self._verdict: str | None = None
        self._steady = 0.0
        self.seen: str | None = None

    def update(self, root_position: Array, rotation: Array, dt: float) -> str | None:
        """Processes the pose dt >= 0 seconds after the last one and returns `seen`.

        `rotation` is that of the root and of each bone in the world, shape (1 + B, 4), `root_position` in m. Frames for
        the experts are interpolated linearly. A pose that is not finite is skipped with its time.
        """
        if not (np.isfinite(root_position).all() and np.isfinite(rotation).all()):
            self.online.skipped += 1
            return self.seen
        self._root[0], self._rotation[0] = self._root[1], self._rotation[1]
        self._root[1], self._rotation[1] = root_position, rotation
        if not self._begun:
            self._begun = True
            self._take(self._still()[1])
            return self.seen
        still: Array | None = None
        for share in self._times.due(dt):
            if still is None:
                still = self._still()
            self._take((1.0 - share) * still[0] + share * still[1])
        return self.seen

    def _still(self) -> Array:
        """The features of the last pose and this one, without velocities, shape (2, C)."""
        return still_features(Clip("now", self._skeleton, 1.0, self._root, self._rotation), self._recipe)

    def _take(self, frame: Array) -> None:
        """Passes a frame at the recognizer's rate, without velocities, to the experts."""
        before = self._frame if self._frame is not None else frame
        self._frame = frame
        if self._recipe.velocity:
            frame = np.concatenate([frame, (frame - before) * (self._recipe.rate * POSITION_UNIT / VELOCITY_UNIT)])
        self.online.update(frame)
        verdict = self.online.motion if self.online.known else None
        self._steady = self._steady + 1.0 / self._recipe.rate if verdict == self._verdict else 0.0
        self._verdict = verdict
        self.seen = verdict if self._steady >= STEADY else None
