"""The control tables of X and MX servos of Protocol 2.0: that of the XM430-W350, with the figures in `x_series.txt`."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from hardware.families.dynamixel2.traits import TRAITS
from hardware.families.register import Register
from hardware.families.rows import file_beside, rows_of
from hardware.families.traits import Traits

_COLUMNS = ("position_p_gain", "position_i_gain", "position_d_gain", "velocity_i_gain", "velocity_p_gain")
_Facts = dict[str, dict[str, int]]


def _facts(row: Sequence[str], traits: Traits) -> _Facts:
    """By register what differs from the XM430-W350: `minimum`, `maximum`, `default`."""
    volts, degrees, current, velocity, *rest = row
    low, high = (int(end) for end in volts.split(".."))
    facts: _Facts = {
        "min_voltage_limit": {"minimum": low, "maximum": high, "default": low},
        "max_voltage_limit": {"minimum": low, "maximum": high, "default": high},
        "temperature_limit": {"default": int(degrees)},
        "velocity_limit": {"default": int(velocity)},
        "present_input_voltage": {"default": round(traits.voltage * 10)},
        "drive_mode": {"maximum": 15 if traits.series.follows else 13},
        "external_port_mode_1": (port := {"maximum": 3, "default": 3}),
        "external_port_mode_2": port,
        "external_port_mode_3": port,
    }
    if current != "-":
        most = int(current)
        facts["current_limit"] = {"maximum": most, "default": most}
        facts["goal_current"] = {"minimum": -most, "maximum": most, "default": most}
        facts["present_current"] = {"minimum": -most, "maximum": most}
    if traits.series.name == "X330":
        facts["baud_rate"] = {"maximum": 6}
        facts["protocol_type"] = {"minimum": 2, "maximum": 22}
        facts["pwm_slope"] = {"minimum": 1, "maximum": 255, "default": 140}
        facts["velocity_limit"]["maximum"] = 2047
        facts["goal_velocity"] = {"minimum": -2047, "maximum": 2047}
    gains, exceptions = rest[: len(_COLUMNS)], rest[len(_COLUMNS) :]
    for name, value in (*zip(_COLUMNS, gains, strict=True), *(word.split("=") for word in exceptions)):
        facts.setdefault(name, {})["default"] = int(value)
    return facts


_FACTS: Mapping[str, _Facts] = {
    model: _facts(row, TRAITS[model]) for model, *row in rows_of(file_beside(__file__, "x_series.txt"))
}


def as_in_manual(model: str, register: Register) -> Register:
    """A register as the XM430-W350 has it, or one that it lacks, with the figures of this model."""
    if register.name == "present_load":
        return replace(register, signed=True, minimum=-1000, maximum=1000, unit="%", scale=0.1)
    if register.unit == "mA":
        register = replace(register, scale=TRAITS[model].current_unit)
    return replace(register, **_FACTS[model].get(register.name, {}))
