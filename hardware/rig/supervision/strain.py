"""Strain: a joint that pushes against something yields before its servo shuts down for overload.

The current of each joint, as a part of what it may take, is smoothed over a quarter of a second. Above 75 % the joint
yields: it aims no farther ahead of where it is than half that current needs, so that it keeps pushing, but gently.
Below 60 % it follows its target again.
"""

from __future__ import annotations

import math

import numpy as np

from hardware.control_table.servo_traits import TRAITS
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.scale import Array

_OVER = 0.25  # s
_STRAINED, _RELIEVED = 0.75, 0.6
_GENTLE = 0.5  # of the current it may take
_MOST = 0.8  # of the stall current, where the rig file has no limit: about where servos report an overload


class Strain:
    """The strain of a rig's J joints.

    Attributes:
        yielding: which joints yield now, shape (J,).
        reach: how far ahead of where it is a yielding joint may aim, shape (J,), rad.
    """

    def __init__(self, config: RigConfig) -> None:
        self._allowed = np.array([_allowed(joint) for joint in config.joints])
        self.reach = np.array([_reach(joint) for joint in config.joints])
        self.yielding = np.zeros(len(config.joints), dtype=np.bool_)
        self._smoothed = np.zeros(len(config.joints))
        self._noted = -math.inf

    def note(self, currents: Array, now: float) -> None:
        """Takes in the currents (J,), A, measured at the time `now`, s."""
        share = -math.expm1(-min(1.0, max(0.0, now - self._noted)) / _OVER)
        self._noted = now
        self._smoothed += (np.abs(currents) / self._allowed - self._smoothed) * share
        self.yielding = self._smoothed > np.where(self.yielding, _RELIEVED, _STRAINED)


def _allowed(joint: RigJoint) -> float:
    """What a joint may take for long, A."""
    return min(joint.current or math.inf, _MOST * TRAITS[joint.model].stall_current)


def _reach(joint: RigJoint) -> float:
    """How far from its goal a servo with the gain it has from the box draws the gentle current, rad."""
    traits = TRAITS[joint.model]
    part = _GENTLE * _allowed(joint) / traits.stall_current
    return traits.error_for(part) / abs(joint.pulses_per_radian)
