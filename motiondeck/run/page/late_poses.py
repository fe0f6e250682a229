"""Poses shown as late as a body follows them."""

from __future__ import annotations

from collections import deque

from controller.motion.posture import Pose
from controller.motion.rotations import Array


class LatePoses:
    """Gives poses back so many seconds after they came; the first one until then."""

    def __init__(self, behind: float) -> None:
        self._behind = behind
        self._poses: deque[tuple[float, Array, Array]] = deque()

    def pose(self, seconds: float, pose: Pose) -> tuple[Array, Array]:
        """Takes the pose of a time, s; place and rotation of the one that was `behind` earlier."""
        self._poses.append((seconds, pose.root_position.copy(), pose.rotation.copy()))
        while len(self._poses) > 1 and self._poses[1][0] <= seconds - self._behind:
            self._poses.popleft()
        return self._poses[0][1:]
