"""Baud rates, and what stands for them in a servo's memory.

Protocol 1.0 servos take 2 Mbps / (value + 1), which is near enough to the usual rates; MX have three faster ones.
"""

from __future__ import annotations

from hardware.control_table.table import ControlTable

BAUD_RATES = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000, 6_000_000, 10_500_000)
"""Bits/s, by what stands in the baud rate register of a Protocol 2.0 servo."""

_OLD = {207: 9600, 34: 57600, 16: 115200, 1: 1_000_000, 0: 2_000_000}
_FAST = {252: 3_000_000}  # MX


def baud_of(table: ControlTable, value: int) -> int:
    """The baud rate that a value of a model's register means, bits/s."""
    if table.protocol == 2:
        return BAUD_RATES[value]
    return (_OLD | _FAST).get(value) or round(2e6 / (value + 1))


def baud_value(table: ControlTable, baud: int) -> int | None:
    """What a model's register holds for a baud rate; None if it cannot be so fast, or so slow."""
    if table.protocol == 2:
        value = BAUD_RATES.index(baud) if baud in BAUD_RATES else None
        return value if value is not None and value <= table["baud_rate"].maximum else None
    known = _OLD | (_FAST if table.model.startswith("MX") else {})
    return next((value for value, rate in known.items() if rate == baud), None)
