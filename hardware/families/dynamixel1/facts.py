"""The facts of AX, RX, and MX with its first firmware (Protocol 1.0); the tables are in `ax_rx.txt` and `mx.txt`."""

from dataclasses import replace
from types import MappingProxyType

from hardware.families.dynamixel1.family import FAMILY
from hardware.families.facts import FamilyFacts, Traits, file_beside, parse_motors, parse_traits
from hardware.families.series import HEAT, OVERLOAD, VOLTAGE, Series
from hardware.families.table import ControlTable, parse_table

_BAUD_RATES = {207: 9600, 34: 57600, 16: 115200, 1: 1_000_000, 0: 2_000_000}
_AX = Series(
    "AX",
    FAMILY,
    baud_rates=MappingProxyType(_BAUD_RATES),
    baud_base=2e6,
    problems=MappingProxyType({bit: bit for bit in (VOLTAGE, HEAT, OVERLOAD)}),
    bulk_reads=False,
    reboots=False,
    shuts_down_by="torque_limit",
)
_MX_RATES = MappingProxyType(_BAUD_RATES | {252: 3_000_000})
_SERIES = (_AX, replace(_AX, name="RX"), replace(_AX, name="MX1", baud_rates=_MX_RATES, bulk_reads=True, reboots=True))

TRAITS = parse_traits(file_beside(__file__, "models.txt"), {series.name: series for series in _SERIES})  # by model name

_AX_RX = file_beside(__file__, "ax_rx.txt")
_MX = file_beside(__file__, "mx.txt")
_STEPS = 1228  # to a turn: 1023 of them are 300 degrees

# What a model has otherwise than its series.
_EXCEPTIONS: dict[str, dict[str, int]] = {
    "AX-12W": {f"{way}_compliance_{what}": n for way in ("cw", "ccw") for what, n in (("margin", 4), ("slope", 64))},
    "AX-18A": {"max_torque": 983, "torque_limit": 983},
    "MX-64(1.0)": {"max_voltage_limit": 240},
}
# The most that a register takes, where that is not as in the table; the MX-64 comes with more than its page allows.
_MOST = {m: {"temperature_limit": 99} for m in ("AX-12W", "AX-18A")} | {"MX-64(1.0)": {"max_voltage_limit": 240}}
_LACKS = {"MX-28(1.0)": ("drive_mode", "current", "torque_control_mode", "goal_torque"), "MX-64(1.0)": ("drive_mode",)}


def _table(model: str, traits: Traits) -> ControlTable:
    number, degrees = traits.figures
    steps, text = (4096, _MX) if traits.series.name == "MX1" else (_STEPS, _AX_RX)
    table = parse_table(model, number, steps, text, traits.series)
    defaults, most = {"model_number": number, "temperature_limit": degrees}, _MOST.get(model, {})
    if traits.series.name == "RX":
        defaults |= {"baud_rate": 34, "max_voltage_limit": 190}
        most = {"min_voltage_limit": 250, "max_voltage_limit": 250}
    for name, value in (defaults | _EXCEPTIONS.get(model, {})).items():
        table.registers[name] = replace(table[name], default=value)
    for name, value in most.items():
        table.registers[name] = replace(table[name], maximum=value)
    for name in _LACKS.get(model, ()):
        del table.registers[name]
    return table


_TABLES = {model: _table(model, traits) for model, traits in TRAITS.items()}
_NUMBERS = {model: table.number for model, table in _TABLES.items()}
_MOTORS = parse_motors(file_beside(__file__, "motors.txt"))

FACTS = FamilyFacts(FAMILY, TRAITS, lambda: _NUMBERS, _TABLES.__getitem__, motors=_MOTORS)
