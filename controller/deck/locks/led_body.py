"""A body led by a person's: beside the motion it shows the difference to what they do, or a share of it.

For the directions of bones, and the height of the root, the difference d from what the motion shows goes to its goal g
critically damped, d'' = w (w (g - d) - 2 d'), at a pace w at which no joint gets a harder push than the motions' own:

    w^2 = min(PACE^2, a / max_j |sum of l (g - d) along the bones to joint j|)

with a the largest acceleration of a joint in the motions and l the lengths of bones. Without a person g is 0.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from controller.motion.rotations import best_fit, between, multiply, normalise, rotate, yaw
from controller.motion.skeleton import Pose, Skeleton
from motiondeck_base.errors import MotiondeckError

PACE = 25.0  # 1/s
MOST = 10.0  # m, and of directions
_NONE = 1e-5  # of a difference and of its rate


class LedBody:
    """What leads from a motion's body to a person's; the largest acceleration of the motions is `hardest`, m/s^2."""

    def __init__(self, skeleton: Skeleton, hardest: float) -> None:
        self._skeleton, self._hardest = skeleton, hardest
        self._reach = np.pad(skeleton.chain * skeleton.length, ((1, 0), (1, 0)))
        self._reach[:, 0] = 1.0
        self._left, self._rate = np.zeros((2, len(skeleton) + 1, 3))
        self._rests = True  # whether nothing of a person is left

    def check(self, body: Sequence[float]) -> None:
        """Checks a body: a weight, then the place of the root and the bones' directions, or nothing.

        From the heading, only the root's height counts. MotiondeckError if it is of another skeleton.
        """
        size = 1 + self._left.size
        fits = not self._skeleton.is_rig and len(body) == size and all(abs(one) <= MOST for one in body)
        if body and not (fits and 0.0 <= body[0] <= 1.0):
            raise MotiondeckError(f"the body of a person is a weight from 0 to 1 and {size - 1} numbers, of a rig none")

    def shown(self, pose: Pose, body: Sequence[float], dt: float) -> Pose:
        """The pose that is shown where the motion has this one dt seconds later."""
        if not body and self._rests:
            return pose
        goal = np.zeros_like(self._left)
        own = rotate(pose.rotation[1:], self._skeleton.rest_direction)
        if body:
            rows = np.array(body[1:]).reshape(-1, 3)
            goal[0, 2] = rows[0, 2] - pose.root_position[2]
            goal[1:] = rotate(yaw(pose.heading), normalise(rows[1:])) - own
            goal *= body[0]
        off = goal - self._left
        pace = min(PACE, (self._hardest / max(np.linalg.norm(self._reach @ off, axis=1).max(), 1e-9)) ** 0.5)
        self._rate += dt * pace * (pace * off - 2.0 * self._rate)
        self._left += dt * self._rate
        self._rests = not body and max(np.abs(self._left).max(), np.abs(self._rate).max()) < _NONE
        bones, first = normalise(own + self._left[1:]), self._skeleton.first
        root = best_fit(bones[first].T @ own[first])
        turns = np.concatenate([root[None], between(own, bones)])
        return replace(pose, root_position=pose.root_position + self._left[0], rotation=multiply(turns, pose.rotation))
