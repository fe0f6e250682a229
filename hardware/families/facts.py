"""The facts of a family: its models, their control tables, traits and identified motors; as text, rows of words.

The figures of a model's motor are those of the maker's specifications at the voltage named. Where a figure differs from
a servo's own register, the register counts.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from hardware.families.family import Family
from hardware.families.series import Series
from hardware.families.table import ControlTable

_CURRENT_MODES = (0, 1, 3, 4, 5, 16)
_VOLTAGE_MODES = (1, 3, 4, 16)


def file_beside(module: str, name: str) -> str:
    """The text of a file in the folder of a module, which is given by its `__file__`."""
    return Path(module).with_name(name).read_text(encoding="utf-8")


def rows_of(text: str) -> list[list[str]]:
    """The words of each row; # begins a comment, and rows without words are left out."""
    return [words for line in text.splitlines() if (words := line.partition("#")[0].split())]


@dataclass(frozen=True, slots=True)
class IdentifiedMotor:
    """A geared direct-current motor, seen from the horn, as others have identified it on real servos.

    Most are of model M6 of BAM (Better Actuator Models, github.com/Rhoban/bam, files `m6` of `bam/params`; Duclusaud,
    Passault et al. 2024), fitted to pendulums of several masses and lengths at several gains; rounded to four digits.
    The share of its supply that a servo uses at most was measured there with an oscilloscope.
    """

    torque_constant: float  # N·m/A, or V/(rad/s)
    resistance: float  # ohm
    armature: float  # inertia of rotor and gears, kg m^2
    duty: float  # the most of its supply that the servo gives to the motor, as a part
    base: float  # friction in motion, N·m
    stribeck: float  # more of it at rest, N·m
    motor: float  # more for each N·m of the motor
    external: float  # more for each N·m of the load
    motor_stribeck: float  # both again at rest
    external_stribeck: float
    motor_quad: float  # at rest, for the square of the torque, 1/(N·m)
    external_quad: float
    slow: float  # speed at which the part at rest ends, rad/s
    alpha: float  # how abruptly
    viscous: float  # N·m/(rad/s)


def parse_motors(text: str) -> Mapping[str, IdentifiedMotor]:
    """The motors of a table by model name: a row each, with the attributes in their order; # begins a comment."""
    return {model: IdentifiedMotor(*map(float, figures)) for model, *figures in rows_of(text)}


@dataclass(frozen=True, slots=True)
class Traits:
    """A servo model that can be a joint of a rig, besides its control table."""

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
    motor = float(rpm), float(stall), 0.0 if torque == "-" else float(torque), float(volt), float(unit)
    own = 0 if stiffness == "-" else int(stiffness), None if fast == "-" else int(fast)
    modes = known[name].modes or (_CURRENT_MODES if float(unit) else _VOLTAGE_MODES)
    numbers = tuple(int(number) for text in figures for number in text.split("/"))
    return Traits(known[name], *motor, *own, modes, numbers)


@dataclass(frozen=True, slots=True)
class FamilyFacts:
    """The facts."""

    family: Family
    traits: Mapping[str, Traits]  # of the models that can be joints of a rig, by name
    numbers: Callable[[], Mapping[str, int]]  # gives the number of each model whose control table is known
    table: Callable[[str], ControlTable]  # gives the control table of such a model
    # The names of its other devices, and why they cannot be joints of a rig, by model number.
    others: Mapping[int, tuple[str, str]] = field(default_factory=dict)
    # Of the models that were identified on real servos, by name.
    motors: Mapping[str, IdentifiedMotor] = field(default_factory=dict)
