"""Checks that every joint follows its target; a jammed or unplugged one does not.

A joint that follows, with whatever delay up to `lag`, is always where its target was at some time within the last `lag`
seconds. So its distance is counted from the range of its own latest targets; a delay costs nothing, a jam shows as soon
as the target has moved away. The experts are no help here: they are shown the stuck joint's own past and soon expect it
to stay where it is (see docs/recognition.md).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError

LAG = 0.25  # s
TOLERANCE = 0.1  # rad
PATIENCE = 0.08  # s; slow walking moves an ankle off its place for 0.1 s only


class FollowingWatch:
    """Watches J joints; each tick costs the same.

    Args:
        joints: J.
        rate: ticks per second, Hz.
        lag: how old a target may be that a joint still follows, s.
        tolerance: how far off a joint may be, rad.
        patience: for how long it may be further off, s; the count falls as fast as it rises.

    Attributes:
        off: how far each joint is from its target, shape (J,), rad.
        moved: how far each joint's targets of the last `lag` seconds lie apart, shape (J,), rad.
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
        """Goes one tick on; which joints do not follow, shape (J,), bool; the next call changes it.

        Args:
            targets: what was commanded in this tick, shape (J,), rad.
            measured: where the joints are, shape (J,), rad; one that is not finite counts as not following.
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
