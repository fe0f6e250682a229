"""Detects joints that do not follow their targets, because they are jammed or unplugged.

A joint that follows with a delay of up to `lag` is always within the range of its targets of the last `lag` seconds.
Its error is the distance from that range: a delay adds nothing, a jam shows as soon as the target has moved away. The
experts cannot detect it: they see the past of the stuck joint and soon expect it to stay (docs/recognition.md).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError

LAG = 0.25  # s
TOLERANCE = 0.1  # rad
PATIENCE = 0.08  # s; in slow walking an ankle moves for only 0.1 s


class FollowingWatch:
    """Monitors J joints at constant cost.

    Args:
        rate: of ticks, Hz.
        lag: largest delay of a joint that follows, s.
        tolerance: error of a joint that follows, rad.
        patience: duration of a larger error until detection, s; the count falls as fast as it rises.

    Attributes:
        off: error of each joint, shape (J,), rad.
        moved: range of each joint's targets of the last `lag` seconds, shape (J,), rad.
    """

    def __init__(
        self, joints: int, rate: float, lag: float = LAG, tolerance: float = TOLERANCE, patience: float = PATIENCE
    ) -> None:
        if joints < 1 or not rate * lag >= 1.0:
            raise MotiondeckError(f"watching {joints} joints at {rate:g} Hz over {lag:g} s is not possible")
        self._period, self._tolerance, self._patience = 1.0 / rate, tolerance, patience
        self._targets = np.zeros((round(rate * lag) + 1, joints))
        self._tick = 0
        self._late = np.zeros(joints)
        self._lowest, self._highest = np.zeros(joints), np.zeros(joints)
        self._bad = np.zeros(joints, dtype=np.bool_)
        self.off = np.zeros(joints)
        self.moved = np.zeros(joints)

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
        np.greater(off, self._tolerance, out=bad)
        self._late -= self._period
        self._late += 2.0 * self._period * bad
        np.clip(self._late, 0.0, 2.0 * self._patience, out=self._late)
        return np.greater(self._late, self._patience, out=bad)
