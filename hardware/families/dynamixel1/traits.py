"""The series and models of Protocol 1.0: AX, RX, and MX with its first firmware."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

from hardware.families.dynamixel1.family import FAMILY
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

_ROWS = """
# model         series rpm  stall_A N·m  V    mA   stiffness fast  number/figures of the series' tables
MX-28(1.0)      MX1    55   1.4   2.5    12   0    850  -   29/80
MX-64(1.0)      MX1    63   4.1   6.0    12   0    850  -   310/80
MX-106(1.0)     MX1    45   5.2   8.4    12   0    850  -   320/80
AX-12A          AX     59   1.5   -      12   0    2835 -   12/70
AX-12W          AX     470  1.4   -      12   0    1418 -   300/70
AX-18A          AX     97   2.2   1.8    12   0    2835 -   18/75
RX-10           RX     54   0.8   1.3    12   0    2835 -   10/80
RX-24F          RX     126  2.4   2.6    12   0    2835 -   24/80
RX-28           RX     85   1.9   3.7    18.5 0    2835 -   28/80
RX-64           RX     64   2.6   5.3    18.5 0    2835 -   64/80
"""

TRAITS = parse_traits(_ROWS, {series.name: series for series in _SERIES})
"""By model name."""
