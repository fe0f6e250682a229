"""The soles of a human: where heel and ball of each foot are, how high, and how still they stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, sin

import numpy as np

from controller.motion.anatomy import anatomy
from controller.motion.posture import Pose
from controller.motion.rest_pose import FOOT_SLOPE
from controller.motion.skeleton import Skeleton
from sim.retargeting.human_limbs import turning

Point = tuple[float, float, float]

HEEL = 1.25 * cos(FOOT_SLOPE)  # lengths of the foot bone from the ball back to the heel


@dataclass(slots=True)
class Sole:
    """One foot: its heel, its ball and its ankle, each x, y, z in m; how far its bone slopes down, rad.

    `lowest` is the height of its lowest point, m.
    """

    heel: Point
    ball: Point
    ankle: Point
    slope: float
    lowest: float


class Soles:
    """Finds the soles of one skeleton. One without feet stands on the lowest of its joints."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        parts = anatomy(skeleton)
        feet = [foot for side in ("right", "left") if (foot := parts.first("foot", side)) is not None]
        self.count = len(feet)
        if not feet:
            return
        # The bones on the way from the root to the toes; balls and foot bones are linear in the products of their
        # quaternions.
        on_way = np.flatnonzero(skeleton.chain[feet].any(axis=0))
        offset = (skeleton.rest_direction * skeleton.length[:, None])[on_way]
        self._rows = (4 * (on_way + 1)[:, None] + np.arange(4)).ravel()
        turn = np.stack([turning(v) for v in offset])  # (B, 16, 3)
        ball = skeleton.chain[feet][:, on_way, None, None] * turn
        own = (on_way == np.array(feet)[:, None])[:, :, None, None] * turn
        self._turn = (
            np.concatenate([ball, own], axis=3).reshape(len(feet), -1, 6).transpose(1, 0, 2).reshape(-1, 6 * len(feet))
        )
        self._back = (HEEL * skeleton.length[feet]).tolist()

    def __call__(self, pose: Pose, flat: Sequence[float]) -> list[Sole]:
        """The right and the left sole; only one, of no length, for a skeleton without feet.

        Args:
            pose: of the human.
            flat: how far the right and the left foot bone slope down where the soles are flat, rad.
        """
        if not self.count:
            joints = self._skeleton.joints(pose.root_position, pose.rotation)
            x, y, z = joints[np.argmin(joints[:, 2])].tolist()
            return [Sole((x, y, z), (x, y, z), (x, y, z), 0.0, z)]
        q = pose.rotation.ravel().take(self._rows).reshape(-1, 4)
        numbers = ((q[:, :, None] * q[:, None, :]).ravel() @ self._turn).tolist()
        rx, ry, rz = pose.root_position.tolist()
        found = []
        for foot, (back, even) in enumerate(zip(self._back, flat, strict=False)):
            bx, by, bz, fx, fy, fz = numbers[6 * foot : 6 * foot + 6]
            x, y, z = rx + bx, ry + by, rz + bz
            # On a flat foot heel and ball are level.
            level = hypot(fx, fy)
            slope = atan2(-fz, level)
            along = back * cos(slope - even) / level if level > 1e-9 else 0.0
            heel = (x - along * fx, y - along * fy, z + back * sin(slope - even))
            found.append(Sole(heel, (x, y, z), (x - fx, y - fy, z - fz), slope, min(heel[2], z)))
        return found
