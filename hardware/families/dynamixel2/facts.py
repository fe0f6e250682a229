"""The facts of the Dynamixel servos of Protocol 2.0: the maker's addresses, and what the maker's files lack.

The `.model` files of the installed dynamixel-sdk give address and length of each register. Sign, access, memory, range,
default and unit come from the XM430-W350's manual, whose register names the others share, with the figures in
`x_series.txt` for each X and MX model. The tables of the P series and the XL-320 are complete. For the Y series and the
RH-P12-RN the range is what the bytes can hold.
"""

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache

from hardware.families.dynamixel2.family import FAMILY, TRAITS, X
from hardware.families.dynamixel2.sdk_models import Row, model_file, model_numbers
from hardware.families.facts import FamilyFacts, Traits, file_beside, parse_motors, rows_of
from hardware.families.register import Register
from hardware.families.table import ControlTable, parse_table

_P_LAYOUT = file_beside(__file__, "p_series.txt")
_NOT_IN_PRO_A = ("protocol_type", "startup_configuration", "backup_ready")
_GAINS = ("velocity_i_gain", "velocity_p_gain", "position_p_gain")
_NO_GAINS = ("position_d_gain", "position_i_gain", "feedforward_2nd_gain", "feedforward_1st_gain")  # 0 as delivered


def _p_series_table(model: str, traits: Traits) -> ControlTable:
    """The table of a P or PRO(A) (e-Manual, each model's page): one layout, each model's own limits."""
    # PRO(A) is the older series, with the same limits and without the newest registers. Both count positions from half
    # a turn below 0 to half a turn above, and refuse a profile beyond their velocity or acceleration limit. The pages
    # of PRO(A) tell no gains; those are left as they are. The indirect addresses are in EEPROM.
    number, current, velocity, half_turn, ends, quickest, acceleration, shutdown, threshold, *gains = traits.figures
    table = parse_table(model, number, 2 * half_turn, _P_LAYOUT, traits.series)

    def limit(name: str, minimum: int, maximum: int, default: int | None) -> None:
        table.registers[name] = replace(table[name], minimum=minimum, maximum=maximum, default=default)

    limit("model_number", 0, 65535, number)
    limit("moving_threshold", 0, velocity, threshold)
    limit("current_limit", 0, current, current)
    limit("acceleration_limit", 0, quickest, acceleration)
    limit("velocity_limit", 0, velocity, velocity)
    limit("max_position_limit", -half_turn, half_turn, ends)
    limit("min_position_limit", -half_turn, half_turn, -ends)
    limit("shutdown", 0, 63 if gains else 255, shutdown)
    limit("goal_current", -current, current, current)
    limit("present_current", -current, current, None)
    limit("goal_velocity", -velocity, velocity, 0)
    limit("profile_acceleration", 0, quickest, 0)
    limit("profile_velocity", 0, velocity, 0)
    for name, gain in zip(_GAINS, gains, strict=False):
        table.registers[name] = replace(table[name], default=gain)
    if not gains:  # PRO(A)
        limit("drive_mode", 0, 1, 0)
        for name in (*_GAINS, *_NO_GAINS):
            table.registers[name] = replace(table[name], default=None)
        for name in _NOT_IN_PRO_A:
            del table.registers[name]
    return table


P_SERIES: dict[str, ControlTable] = {
    model: _p_series_table(model, traits) for model, traits in TRAITS.items() if traits.series.name == "P"
}
"""By model name."""

_XM430_W350 = parse_table("XM430-W350", 1020, 4096, file_beside(__file__, "xm430_w350.txt"), X)
# 1023 of the 1228 steps to a turn are 300 degrees.
_XL_320 = parse_table("XL-320", 350, 1228, file_beside(__file__, "xl_320.txt"), TRAITS["XL-320"].series)
_COMMON = _XM430_W350.registers
_OWN = P_SERIES | {table.model: table for table in (_XM430_W350, _XL_320)}
_READ_ONLY = (
    *("present_", "model_", "firmware_", "moving", "realtime_", "registered_", "hardware_", "error_code", "backup_"),
    *("position_trajectory", "velocity_trajectory", "controller_state"),
)
_RAD_PER_S = 2.0 * math.pi / 60.0


@cache
def numbers() -> dict[str, int]:
    """The number of each model whose table is known."""
    own = {model: traits.figures[0] for model, traits in TRAITS.items() if traits.figures}
    return {_XM430_W350.model: _XM430_W350.number} | model_numbers() | own


@cache
def table(model: str) -> ControlTable:
    """The control table of a model."""
    if (own := _OWN.get(model)) is not None:
        return own
    file = model_file(model)
    traits = TRAITS.get(model)
    rows = list(_with_cells(file.rows, traits is not None))
    torque = next((row.address for row in rows if row.name == "torque_enable"), 0)
    rpm = round(file.rad_per_s / _RAD_PER_S, 3)  # one count of velocity, which the file gives rounded
    make = _register_like_xm430 if traits is not None else _plain_register
    registers = {row.name: make(row, torque, rpm) for row in rows}
    if traits is not None:
        registers = {name: _as_in_manual(model, register) for name, register in registers.items()}
    registers["model_number"] = replace(registers["model_number"], default=numbers()[model])
    series = traits.series if traits is not None else X
    return ControlTable(model, numbers()[model], file.pulses_per_turn, registers, series)


def _with_cells(rows: tuple[Row, ...], whole: bool) -> Iterator[Row]:
    """The rows, with those indirect cells that the file leaves to its reader, and the XM430's newer registers."""
    have = {row.name: row for row in rows}
    first, data = have.get("indirect_address_1"), have.get("indirect_data_1")
    cells: list[Row] = []
    if first and data:
        count = min(28, (data.address - first.address) // 2)
        cells = [Row(first.address + 2 * cell, 2, f"indirect_address_{cell + 1}") for cell in range(count)]
        cells += [Row(data.address + cell, 1, f"indirect_data_{cell + 1}") for cell in range(count)]
    taken = {place for row in rows for place in range(row.address, row.address + row.length)}
    newer = [
        Row(register.address, register.length, name)
        for name in ("startup_configuration", "backup_ready")
        if whole and (register := _COMMON[name]).address not in taken
    ]
    plain = [row for row in rows if not (row.name.startswith("indirect_") and (cells or row.name[-1] in "de"))]
    yield from sorted((*plain, *cells, *newer), key=lambda row: row.address)


def _register_like_xm430(row: Row, torque: int, rpm: float) -> Register:
    """A register whose name the XM430 has too; its own words, at this model's place."""
    like = _COMMON.get(row.name)
    if like is None or like.length != row.length:
        return _plain_register(row, torque, rpm)
    scale = rpm if like.unit == "rpm" and rpm else like.scale
    return replace(like, address=row.address, scale=scale)


def _plain_register(row: Row, torque: int, rpm: float) -> Register:
    like = _COMMON.get(row.name)
    signed = row.name == "present_load" or row.name.endswith("_offset")
    signed = signed if like is None else like.signed and like.length == row.length
    # The Y series counts positions from -half a turn to +half a turn.
    signed = signed or (row.name.endswith("position_limit") and row.length == 4)
    bits = 8 * row.length
    unit, scale = ("", 1.0) if like is None else (like.unit, like.scale)
    scale = rpm if unit == "rpm" and rpm else scale
    return Register(
        name=row.name,
        address=row.address,
        length=row.length,
        signed=signed,
        access="R" if row.name.startswith(_READ_ONLY) and row.name != "moving_threshold" else "RW",
        memory="EEPROM" if row.address < torque else "RAM",
        minimum=-(1 << bits - 1) if signed else 0,
        maximum=(1 << bits - (1 if signed else 0)) - 1,
        default=None,
        unit=unit,
        scale=scale,
    )


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
        **{f"external_port_mode_{number}": {"maximum": 3, "default": 3} for number in (1, 2, 3)},
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


def _as_in_manual(model: str, register: Register) -> Register:
    """A register as the XM430-W350 has it, or one that it lacks, with the figures of this model."""
    if register.name == "present_load":
        return replace(register, signed=True, minimum=-1000, maximum=1000, unit="%", scale=0.1)
    if register.unit == "mA":
        register = replace(register, scale=TRAITS[model].current_unit)
    return replace(register, **_FACTS[model].get(register.name, {}))


_OTHERS = {
    int(number): (name, why)
    for why, devices in tomllib.loads(file_beside(__file__, "others.toml")).items()
    for number, name in devices.items()
}
FACTS = FamilyFacts(FAMILY, TRAITS, numbers, table, _OTHERS, parse_motors(file_beside(__file__, "motors.txt")))
