"""The limits of a join: no body point may move much faster, or be accelerated much harder, than in both motions."""

from __future__ import annotations

import numpy as np

from controller.deck.joins.deck_motions import Motion
from controller.mocap.encodings.joint_angles import JointBody
from controller.mocap.posture import Pose
from controller.mocap.skeleton import Skeleton
from controller.rotations import Array

FASTEST, HARDEST = 1.5, 2.0
"""A join moves a body point at most so many times as fast, and accelerates it so many times as hard, as its motions."""


class JoinLimits:
    """Watches the joints in the world while motions are joined.

    Args:
        skeleton: of the poses.
        before, now: the last two poses that were shown; before the second one there is no acceleration yet.
    """

    def __init__(self, skeleton: Skeleton | JointBody, before: Pose | None, now: Pose) -> None:
        self._skeleton = skeleton
        self._now = self._joints(now)
        self._before = self._joints(before) if before is not None else None
        self._motions: tuple[Motion, ...] = ()
        self._speed = self._acceleration = 0.0

    def begin(self, *motions: Motion) -> None:
        """Sets the limits to those of a join of these motions; the motions of the join that it interrupts count too."""
        allowed = (*self._motions, *motions)
        self._motions = motions
        self._speed = FASTEST * max(motion.speed for motion in allowed)
        self._acceleration = HARDEST * max(motion.acceleration for motion in allowed)

    def use(self, pose: Pose, dt: float) -> float:
        """How much of the limits the joints need if this pose comes dt seconds after the last; 1 is the limit."""
        step = self._joints(pose) - self._now
        change = step - (self._now - self._before) if self._before is not None else np.zeros(3)
        speed, acceleration = (float(np.square(part).sum(-1).max()) ** 0.5 for part in (step, change))
        return max(speed / (self._speed * dt), acceleration / (self._acceleration * dt * dt))

    def accept(self, pose: Pose) -> None:
        """Takes a pose for the last one that was shown."""
        self._before, self._now = self._now, self._joints(pose)

    def _joints(self, pose: Pose) -> Array:
        return self._skeleton.joints(pose.root_position, pose.rotation)
