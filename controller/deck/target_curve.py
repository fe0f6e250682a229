"""A curve through the targets of a deck that can be read at any time: the uniform cubic B-spline.

With a target p[i] in each tick of T seconds,

    q(t) = sum_i B(t / T - i) p[i].

Each derivative of q is a mean of the differences of the same order of the targets, with weights that are not negative
and sum to 1 (de Boor, "A Practical Guide to Splines", chapter X). So where the targets keep limits of position,
velocity, acceleration and jerk from tick to tick, the curve keeps them at all times, however irregularly it is read. It
follows the targets two ticks later.
"""

from collections import deque

import numpy as np

from controller.motion.rotations import Array, dot, normalise
from controller.motion.skeleton import Pose

DELAY_TICKS = 2
# Rows: the weights of four targets for 1, u, u^2, u^3, where u in [0, 1] leads from the second to the third.
_BASIS: Array = np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]], dtype=np.float64) / 6.0


class TargetCurve:
    """The curve through the latest targets and poses; before the first tick the joints, (J,), rad, are at rest."""

    def __init__(self, targets: Array, pose: Pose) -> None:
        self._targets = np.tile(targets, (4, 1))
        self._poses = deque([pose] * 4, maxlen=4)

    def add(self, targets: Array, pose: Pose) -> None:
        """Adds the targets (J,), rad, and the pose of a tick."""
        self._targets[:3] = self._targets[1:]
        self._targets[3] = targets
        self._poses.append(pose)

    def hold(self) -> None:
        """Adds a tick at the latest targets and pose."""
        self.add(self._targets[3], self._poses[3])

    def targets(self, share: float) -> Array:
        """The joint targets (J,), rad, after a share in [0, 1] of the latest tick."""
        return _weights(share) @ self._targets

    def pose(self, share: float) -> Pose:
        """The pose after a share in [0, 1] of the latest tick."""
        weights, poses = _weights(share), self._poses
        rotations = np.array([pose.rotation for pose in poses])
        sides = np.where(dot(rotations, rotations[-1]) < 0.0, -1.0, 1.0) * weights[:, None]
        position = weights @ np.array([pose.root_position for pose in poses])
        heading = np.asarray(weights @ np.array([pose.heading for pose in poses]))
        return Pose(position, heading, normalise((sides[..., None] * rotations).sum(0)), offsets=poses[-1].offsets)


def _weights(share: float) -> Array:
    return share ** np.arange(4.0) @ _BASIS
