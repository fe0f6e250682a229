"""What a servo model is besides its control table, one row a model that can be a joint of a rig.

Figures of the motor are those of the maker's specifications at the voltage named. Where a figure differs from a servo's
own register, the register counts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hardware.families.rows import rows_of
from hardware.families.series import Series

_CURRENT_MODES = (0, 1, 3, 4, 5, 16)
_VOLTAGE_MODES = (1, 3, 4, 16)


@dataclass(frozen=True, slots=True)
class Traits:
    """A servo model."""

    series: Series  # what it shares with others
    no_load_speed: float  # of the horn at `voltage`, rev/min
    stall_current: float  # A
    stall_torque: float  # of the horn, N·m; 0 where the maker specifies none
    voltage: float  # V
    current_unit: float  # mA that one count of current means; 0 where the model measures load, in 0.1 %
    stiffness: int  # its position gain in the unit of the X series; 0 where that is the default of its P gain
    fast_read: int | None  # the firmware from which it answers fast sync and fast bulk reads; None for never
    modes: tuple[int, ...]
    # The model number where the maker's files lack it, then what the tables of its series need besides.
    figures: tuple[int, ...]


def parse_traits(text: str, series: Mapping[str, Series]) -> dict[str, Traits]:
    """Reads rows of  model, series, rpm, stall A, N·m, V, mA, stiffness, fast read, number/figures;  by model name."""
    return {model: _traits(row, series) for model, *row in rows_of(text)}


def _traits(row: Sequence[str], known: Mapping[str, Series]) -> Traits:
    name, rpm, stall, torque, volt, unit, stiffness, fast, *figures = row
    series = known[name]
    return Traits(
        series,
        float(rpm),
        float(stall),
        0.0 if torque == "-" else float(torque),
        float(volt),
        float(unit),
        0 if stiffness == "-" else int(stiffness),
        None if fast == "-" else int(fast),
        series.modes or (_CURRENT_MODES if float(unit) else _VOLTAGE_MODES),
        tuple(int(number) for text in figures for number in text.split("/")),
    )
