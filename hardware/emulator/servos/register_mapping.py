"""Servos without an operating mode on the registers of those that have one.

A bank computes with the registers of `MAPPED_TO`. Those that a servo lacks stand behind its own memory, out of reach of
the bus, and follow its own registers: the torque limit is a goal PWM, and both angle limits at 0, or control mode 1,
make a wheel. Of its gains P and the compliance slopes count; dividers do nothing.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from hardware.emulator.servos.drive import VELOCITY, MotorDrive
from hardware.families.models import MAPPED_TO, TRAITS
from hardware.families.register import Register
from hardware.families.table import ControlTable

_BEHIND = 1024  # bytes: farther than the memory of these servos reaches
_LACKING = ("indirect_", "present_current", "goal_current", "current_limit", "startup_configuration", "backup_ready",
            "protocol_type", "model_information", "acceleration_limit")  # fmt: skip
_FULL_PWM = 885.0


def whole_table(table: ControlTable) -> ControlTable:
    """The table with the registers of `MAPPED_TO` that it lacks, out of reach; the same where it has the mode."""
    if "operating_mode" in table.registers:
        return table
    hidden = {
        name: replace(register, address=_BEHIND + register.address)
        for name, register in MAPPED_TO.registers.items()
        if name not in table.registers and not name.startswith(_LACKING)
    }
    return replace(table, registers=table.registers | hidden)


def follow(registers: np.ndarray[Any, Any], table: ControlTable, drive: MotorDrive) -> None:
    """Makes the hidden registers and the motors of a bank follow the servos' own registers."""
    wheel = (registers["min_position_limit"] == 0) & (registers["max_position_limit"] == 0)
    if "control_mode" in table.registers:
        wheel = registers["control_mode"] == 1
    registers["operating_mode"] = np.where(wheel, VELOCITY, 3)
    per_count = table["profile_velocity"].si / table["goal_velocity"].si
    registers["goal_velocity"] = np.rint(
        signed(registers["profile_velocity"], table["profile_velocity"]) * per_count * wheel
    )
    registers["goal_pwm"] = np.rint(registers["torque_limit"] * _FULL_PWM / table["torque_limit"].maximum)
    if "cw_compliance_slope" in table.registers:
        slope = np.maximum(registers["cw_compliance_slope"], registers["ccw_compliance_slope"])
        drive.p_gain = _FULL_PWM / np.maximum(slope, 2)  # the least counts as 2
    else:
        usual = TRAITS[table.model].stiffness / table.series.gain_unit
        drive.p_gain = registers["position_p_gain"] * usual / (table["position_p_gain"].default or 1)
    drive.i_gain, drive.d_gain = np.zeros(len(registers)), np.zeros(len(registers))


def signed(counts: np.ndarray[Any, Any], register: Register) -> np.ndarray[Any, np.dtype[np.float64]]:
    """What the counts of a register mean as numbers, where one bit of it may be their sign."""
    if not (bit := register.sign_bit):
        return counts.astype(np.float64)
    return np.where(counts >> bit & 1, -1.0, 1.0) * (counts & (1 << bit) - 1).astype(np.float64)


def with_sign(values: np.ndarray[Any, np.dtype[np.float64]], register: Register) -> np.ndarray[Any, np.dtype[Any]]:
    """The inverse of `signed`."""
    if not (bit := register.sign_bit):
        return values
    size = np.minimum(np.abs(values), (1 << bit) - 1).astype(np.uint16)
    return size | np.where(values < 0.0, 1 << bit, 0).astype(np.uint16)
