"""Catching up: after a recovery a joint goes to its target at a quarter of its speed limit, until it is there.

Its goal may reach the target while the joint is still far off, or turns away. It has caught up when it is no farther
behind than so many seconds at the speed of its target and so many rad, or, if load or a hand keeps it, after a while.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array

SLOWER = 0.25
"""The part of its speed limit at which a joint catches up."""
_ARRIVED = 0.02  # rad between goal and target
_LAG, _PLAY, _PATIENCE = 0.15, 0.05, 2.0  # s, rad, s


class CatchingUp:
    """Which of a rig's J joints catch up.

    Attributes:
        joints: those that do, shape (J,).
    """

    def __init__(self, config: RigConfig) -> None:
        count = len(config.joints)
        self.joints = np.zeros(count, dtype=np.bool_)
        self._speed = SLOWER * np.array([joint.velocity for joint in config.joints])
        self._lower = np.array([joint.lower for joint in config.joints])
        self._upper = np.array([joint.upper for joint in config.joints])
        self._since = np.full(count, np.inf)  # when the goal of a joint has arrived at its target, s
        self._targets = np.full(count, np.nan)  # the last ones, within the limits, rad

    @property
    def pace(self) -> Array:
        """The part of its speed limit that each joint may use, shape (J,)."""
        return np.where(self.joints, SLOWER, 1.0)

    def note(
        self, targets: Array, goals: Array, positions: Array, kept: NDArray[np.bool_], passed: float, now: float
    ) -> None:
        """Lets go of the joints that have caught up.

        Args:
            targets, goals, positions: asked for, sent and measured, shape (J,), rad.
            kept: which joints are not let go, shape (J,).
            passed: since the last call, s.
            now: the time, s.
        """
        # A joint that stands at a limit has caught up with a target beyond it.
        targets = np.clip(targets, self._lower, self._upper)
        arrived = np.abs(targets - goals) < _ARRIVED
        self._since = np.where(arrived & self.joints, np.minimum(self._since, now), np.inf)
        speed = np.fmin(np.abs(targets - self._targets) / max(passed, 1e-3), self._speed)
        self._targets = targets
        there = np.abs(goals - positions) < _PLAY + _LAG * speed
        self.joints &= kept | ~(arrived & (there | (now - self._since > _PATIENCE)))
