"""The series and models of Protocol 1.0: AX, RX, and MX with its first firmware."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

from hardware.families.dynamixel1.family import FAMILY
from hardware.families.rows import file_beside
from hardware.families.series import HEAT, OVERLOAD, VOLTAGE, Series
from hardware.families.traits import parse_traits

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
_SERIES = (
    _AX,
    replace(_AX, name="RX"),
    replace(_AX, name="MX1", baud_rates=_MX_RATES, bulk_reads=True, reboots=True),
)

TRAITS = parse_traits(file_beside(__file__, "models.txt"), {series.name: series for series in _SERIES})  # by model name
