"""A control table: the registers of one model, read from text that looks like its manual; and their counts in words."""

from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np

from hardware.errors import MotiondeckError
from hardware.families.family import Family
from hardware.families.register import SI_UNITS, Register
from hardware.families.series import Series
from motiondeck_base.words import did_you_mean

_SIGN_BIT = 10
_HARDWARE_ERRORS = {1: "input voltage", 4: "overheated", 8: "encoder", 16: "electrical shock", 32: "overload"}
_OPERATING_MODES = {0: "current", 1: "velocity", 3: "position", 4: "extended position", 5: "current-based position",
                    16: "PWM"}  # fmt: skip
_SWITCHES = ("torque_enable", "led", "moving", "registered_instruction", "backup_ready", "lock")


@dataclass(frozen=True)
class ControlTable:
    """The registers of a model, by name and by address."""

    model: str  # the maker's name, "XM430-W350"
    number: int  # the model number a ping answers with
    pulses_per_turn: int  # position counts in one turn of the horn
    registers: dict[str, Register]
    series: Series  # what it shares with other models

    def __getitem__(self, name: str) -> Register:
        """The register of this name; a MotiondeckError has the nearest names."""
        try:
            return self.registers[name]
        except KeyError:
            hint = did_you_mean(name, self.registers) or f" It has: {', '.join(self.registers)}."
            raise MotiondeckError(f"{self.model} has no register '{name}'.{hint}") from None

    @property
    def size(self) -> int:
        """How many bytes the whole table spans."""
        return max(register.address + register.length for register in self.registers.values())

    @property
    def one_turn(self) -> tuple[int, int]:
        """The lowest and the highest position of position mode."""
        low = self["min_position_limit"]
        if low.minimum == 0:
            return 0, min(low.maximum, self.pulses_per_turn - 1)
        return -(self.pulses_per_turn // 2), self.pulses_per_turn // 2

    @property
    def family(self) -> Family:
        """The family that it belongs to."""
        return self.series.family

    def baud_value(self, baud: int) -> int | None:
        """The value of its register for a baud rate; None if it cannot be so fast, or so slow."""
        value = next((value for value, rate in self.series.baud_rates.items() if rate == baud), None)
        return value if value is not None and value <= self["baud_rate"].maximum else None

    def dtype(self) -> np.dtype[Any]:
        """The layout of the table as a numpy record, to see the memories of many servos at once."""
        rows = list(self.registers.values())
        return np.dtype(
            {
                "names": list(self.registers),
                "formats": [f"<{'i' if row.signed else 'u'}{row.length}" for row in rows],
                "offsets": [row.address for row in rows],
                "itemsize": self.size,
            }
        )


def parse_table(model: str, number: int, pulses_per_turn: int, text: str, series: Series) -> ControlTable:
    """Reads rows of  address, length, name, access, memory, range, default, unit;  # starts a comment.

    A length of `2s` is two bytes, signed; `2m` two bytes with a size and, in bit 10, its sign, `2m15` in bit 15; `-`
    stands for no default and for no unit; `*1:28` behind a name makes 28 registers name_1, name_2, ... one behind the
    other, and a default of `224+` counts up along with them. ValueError if a row has other columns, overlaps its
    neighbour, or uses an unknown word; it quotes the row.
    """
    registers: dict[str, Register] = {}
    end = 0
    for line in text.splitlines():
        row = line.partition("#")[0].split()
        if not row:
            continue
        try:
            for register in _registers(row):
                if register.address < end or register.name in registers:
                    raise ValueError("overlaps what stands before it")
                registers[register.name] = register
                end = register.address + register.length
        except (ValueError, KeyError) as error:
            raise ValueError(f"control table of {model}, row '{line.strip()}': {error}") from error
    return ControlTable(model, number, pulses_per_turn, registers, series)


def _registers(row: list[str]) -> list[Register]:
    address, length_word, name, access, memory, range_word, default_word, unit_word = row
    if access not in ("R", "RW") or memory not in ("EEPROM", "RAM"):
        raise ValueError("access is R or RW, memory EEPROM or RAM")
    base, _, span = name.partition("*")
    first, _, last = span.partition(":")
    names = [f"{base}_{number}" for number in range(int(first), int(last) + 1)] if span else [base]
    length = int(length_word.partition("m")[0].rstrip("s"))
    minimum, maximum = (int(word) for word in range_word.split(".."))
    default = None if default_word == "-" else int(default_word.rstrip("+"))
    scale, unit = _unit(unit_word)
    return [
        Register(
            name=each,
            address=int(address) + index * length,
            length=length,
            signed=length_word.endswith("s"),
            access=cast(Literal["R", "RW"], access),
            memory=cast(Literal["EEPROM", "RAM"], memory),
            minimum=minimum,
            maximum=maximum,
            default=default + index if default is not None and default_word.endswith("+") else default,
            unit=unit,
            scale=scale,
            sign_bit=int(length_word.partition("m")[2] or _SIGN_BIT) if "m" in length_word else 0,
        )
        for index, each in enumerate(names)
    ]


def _unit(word: str) -> tuple[float, str]:
    """Scale and unit of a word such as 0.229rpm."""
    if word == "-":
        return 1.0, ""
    for unit in sorted(SI_UNITS, key=len, reverse=True):
        if unit and word.endswith(unit):
            return float(word.removesuffix(unit)), unit
    raise ValueError(f"the unit '{word}' is unknown")


def describe_errors(bits: int, none: str = "no error") -> str:
    """The bits of a hardware error status, or of a shutdown mask, in words."""
    return ", ".join(text for bit, text in _HARDWARE_ERRORS.items() if bits & bit) or none


def meaning(table: ControlTable, register: Register, count: int) -> str:
    """What a count means in a register of a model; "" where it is just a number."""
    name = register.name
    if name == "baud_rate":
        baud = table.series.baud_of(count)
        return f"{baud} baud" if baud else "no baud rate"
    if name == "operating_mode":
        return _OPERATING_MODES.get(count, "unknown")
    if name == "hardware_error_status":
        return describe_errors(table.series.usual_problems(count))
    if name == "shutdown":
        return f"at {describe_errors(table.series.usual_problems(count), 'nothing')}"
    if name in _SWITCHES:
        return "on" if count else "off"
    if register.unit == "pulse":
        return f"{360.0 * count * register.scale / table.pulses_per_turn:.1f} deg"
    if register.unit == "rev/min2":
        return f"{count * register.si:.5g} rad/s2"
    return f"{count * register.scale:.5g} {register.unit}" if register.unit else ""
