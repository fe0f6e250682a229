"""What servos keep themselves and a rig file does not ask for: read when they are switched on, and never written."""

from typing import NamedTuple

import numpy as np

from hardware.bus.servo_bus import Bus
from hardware.rig.registers import read_register
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint
from hardware.rig.scale import Array


class OwnSettings(NamedTuple):
    """The own settings of J servos."""

    hottest: Array  # the temperature at which each shuts down, shape (J,), degC
    slack: Array  # how far from its goal each drives with its full voltage, shape (J,), rad


def read_own_settings(config: RigConfig, bus: Bus) -> OwnSettings:
    """Reads temperature limit and position gain of every servo; a ServoError if one does not answer."""
    limits = [read_register(joint, bus, "temperature_limit") for joint in config.joints]
    return OwnSettings(np.array(limits, dtype=np.float64), np.array([_slack(joint, bus) for joint in config.joints]))


def _slack(joint: RigJoint, bus: Bus) -> float:
    if "position_p_gain" not in joint.table.registers:
        return joint.slack()
    return joint.slack(read_register(joint, bus, "position_p_gain"))
