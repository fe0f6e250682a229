"""Servos without an operating mode (AX, RX, MX of Protocol 1.0, XL-320) on the registers of the X series.

A bank computes with an X servo's registers. Those that a servo lacks stand behind its own memory, out of reach of the
bus, and follow its own registers: the torque limit is a goal PWM, and both angle limits at 0, or control mode 1, make
a wheel. Of its gains P and the compliance slopes count; offsets and dividers do nothing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from hardware.emulator.servos.drive import VELOCITY, MotorDrive
from hardware.families.dynamixel2.xm430_w350 import XM430_W350
from hardware.families.table import ControlTable

_BEHIND = 1024  # bytes: farther than the memory of these servos reaches
_LACKING = ("indirect_", "present_current", "goal_current", "current_limit", "startup_configuration", "backup_ready",
            "protocol_type", "model_information", "acceleration_limit")  # fmt: skip
_FULL_PWM, _FULL_TORQUE = 885.0, 1023.0
_STIFF = 850.0 / 128.0 / 32.0 * 4096.0  # PWM per turn of error that a P gain of 1 gives; MX have 850 for it now
_SIGN = 1024


def whole_table(table: ControlTable) -> ControlTable:
    """The table with the registers of an X servo that it lacks, out of reach; the same where it has the mode."""
    if "operating_mode" in table.registers:
        return table
    hidden = {
        name: replace(register, address=_BEHIND + register.address)
        for name, register in XM430_W350.registers.items()
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
    registers["goal_velocity"] = np.rint(signed(registers["profile_velocity"]) * per_count * wheel)
    registers["goal_pwm"] = np.rint(registers["torque_limit"] * _FULL_PWM / _FULL_TORQUE)
    if "cw_compliance_slope" in table.registers:
        drive.p_gain = _FULL_PWM / np.maximum(registers["cw_compliance_slope"], registers["ccw_compliance_slope"])
    else:
        drive.p_gain = registers["position_p_gain"] * (_STIFF / table.pulses_per_turn)
    drive.i_gain, drive.d_gain = np.zeros(len(registers)), np.zeros(len(registers))


def signed(counts: np.ndarray[Any, Any]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Speeds and loads, whose bit 10 is their sign, as numbers."""
    return np.where(counts & _SIGN, -1.0, 1.0) * (counts & _SIGN - 1).astype(np.float64)


def with_sign(values: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.uint16]]:
    """The inverse of `signed`."""
    size = np.minimum(np.abs(values), _SIGN - 1).astype(np.uint16)
    return size | np.where(values < 0.0, _SIGN, 0).astype(np.uint16)
