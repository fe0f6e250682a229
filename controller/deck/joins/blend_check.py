"""Checks a blend of motions while it plays: it may stand still, or a bone that points opposite ways may turn over.

The criteria are those of `benchmarks/deck/blends.py`: within half a second no joint moves a tenth as far as in the
motion that moves least; or a joint moves two and a half times as fast as it ever does in any of them.
"""

from __future__ import annotations

import numpy as np

from controller.deck.joins.deck_motions import Motion
from controller.motion.rotations import Array

STILL, TURNS_OVER = 0.1, 2.5
HALF_A_SECOND = 0.5


class BlendCheck:
    """Checks one blend.

    Args:
        motions: that are blended.
    """

    def __init__(self, *motions: Motion) -> None:
        self._least = STILL * min(float(np.ptp(motion.places, axis=0).max()) for motion in motions)
        self._fastest = TURNS_OVER * max(float(np.abs(motion.velocities).max()) for motion in motions)
        self._last: Array | None = None
        self._begin_window()

    def problem(self, places: Array, dt: float) -> str:
        """The problem of the blend: "stands still", "turns over", or "" for none.

        Args:
            places: joint positions, as `Motion.places` has them, shape (F,), m.
            dt: how much of the motion was played since the last call, s; 0 in a pause.
        """
        last, self._last = self._last, places
        if last is not None and float(np.abs(places - last).max()) > self._fastest * dt > 0.0:
            return "turns over"
        self._low, self._high = np.minimum(self._low, places), np.maximum(self._high, places)
        self._played += dt
        if self._played < HALF_A_SECOND:
            return ""
        still = float((self._high - self._low).max()) < self._least
        self._begin_window()
        return "stands still" if still else ""

    def _begin_window(self) -> None:
        self._low: Array = np.array(np.inf)
        self._high: Array = np.array(-np.inf)
        self._played = 0.0
