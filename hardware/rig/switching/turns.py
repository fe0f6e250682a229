"""Whole turns: where angle 0 of each joint is as its servo counts now.

In position mode a servo reports its place in one turn. In the other modes it counts on through whole turns, and begins
anew within one when its power comes back. The place in one turn is then enough where the joint's range is shorter than
a turn; else the place that the joint is believed to have decides.
"""

from __future__ import annotations

import numpy as np

from hardware.bus.servo_bus import Bus
from hardware.errors import RigError
from hardware.rig.registers import read_register
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import POSITION_MODE, RigJoint
from hardware.rig.scale import Array, RigScale

_SURE = 0.25  # of a turn: farther from where it is believed, a servo may stand in another one


def find_zeros(config: RigConfig, bus: Bus, believed: Array) -> Array:
    """The position of each servo at angle 0 as it counts now, shape (J,), pulses.

    Args:
        config: the rig.
        bus: of its servos.
        believed: where each joint stands, shape (J,), rad, roughly; NaN where that is not known.

    Raises:
        RigError: if a joint with a range of a turn or more may stand in another turn; it is named with the remedy.
    """
    zeros = RigScale(config).zero
    for index, joint in enumerate(config.joints):
        if joint.mode != POSITION_MODE:
            zeros[index] += _whole_turns(joint, read_register(joint, bus, "present_position"), float(believed[index]))
    return zeros


def _whole_turns(joint: RigJoint, pulses: int, believed: float) -> int:
    """The pulses of the whole turns that a servo counts more than from the rig file's zero."""
    if not joint.several_turns:
        return joint.whole_turns(pulses)
    if not np.isfinite(believed):
        raise RigError(f"{joint.label} goes through several turns, and its turn is not known. {REMEDY}")
    turn = joint.table.pulses_per_turn
    away = (pulses - joint.pulses(believed)) / turn
    if abs(away - round(away)) > _SURE:
        raise RigError(f"{joint.label} is not where it was: it may stand in another turn. {REMEDY}")
    return round(away) * turn


REMEDY = "Put it at its angle 0 and store that with motiondeck rig turns RIG."
