"""Arranging each servo's indirect cells for the loop, and trusting them only after a look.

Where the cells of a servo are depends on model and firmware, and the tables do not cover every firmware. So after the
pointers are written the block is read, and beside it the registers themselves: where the two differ, the servo is read
in place instead.

These functions wait for answers; they are not for use inside a loop.
"""

from __future__ import annotations

import numpy as np

from hardware.bus.servo_bus import Bus
from hardware.errors import RefusedError
from hardware.rig.driving.state_block import StateBlock, arranged, everything, motion
from hardware.rig.rig_file import RigConfig, RigJoint

_ALIKE = {"hardware_error_status": 0, "torque_enable": 0, "present_temperature": 3, "present_input_voltage": 10}
"""By how many counts two looks at a healthy servo may differ, a few ms apart."""


def arrange_state(config: RigConfig, bus: Bus) -> list[StateBlock]:
    """What to read of each joint in the loop: its arranged cells, or its registers in place.

    Raises:
        NoReplyError: if a servo stays silent.
        SerialPortError: if the port vanishes.
    """
    return [_arrange(joint, bus) for joint in config.joints]


def _arrange(joint: RigJoint, bus: Bus) -> StateBlock:
    in_place = motion(joint.table)
    firmware = joint.table["firmware_version"]
    version = firmware.decode(bus.read(joint.id, firmware.address, firmware.length).params)
    plan = arranged(joint.table, version)
    if plan is None:
        return in_place
    try:
        # Some models keep these pointers in EEPROM, whose cells wear out.
        if bus.read(joint.id, plan.address, len(plan.pointers)).params != plan.pointers:
            bus.write(joint.id, plan.address, plan.pointers)
        shown = _look(joint, bus, plan.block)
    except RefusedError:
        return in_place
    beside = _look(joint, bus, everything(joint.table))
    alike = all(abs(int(shown[name]) - int(beside[name])) <= counts for name, counts in _ALIKE.items())
    return plan.block if alike and int(shown["present_input_voltage"]) else in_place


def _look(joint: RigJoint, bus: Bus, block: StateBlock) -> np.void:
    return np.frombuffer(bus.read(joint.id, block.address, block.length).params, dtype=block.layout)[0]
