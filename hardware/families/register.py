"""A register: one row of a control table, which turns numbers into bytes and counts into SI units."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Literal

import msgspec

Counts = Annotated[int, msgspec.Meta(ge=-(2**31), lt=2**32)]  # a number that a register can hold

# What one of a manual's units is in SI.
SI_UNITS = {
    "": 1.0, "pulse": 1.0, "rpm": 2.0 * math.pi / 60.0, "rev/min2": 2.0 * math.pi / 3600.0, "deg/s2": math.pi / 180.0,
    "mA": 1e-3, "V": 1.0, "degC": 1.0, "%": 1e-2, "ms": 1e-3, "us": 1e-6,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Register:
    """One register of a servo."""

    name: str
    address: int  # of its first byte
    length: int  # 1, 2 or 4 bytes, little-endian
    signed: bool  # whether it holds negative numbers (two's complement)
    access: Literal["R", "RW"]
    memory: Literal["EEPROM", "RAM"]  # EEPROM is kept without power, and locked while torque is on
    minimum: int  # the least that may be written, in counts
    maximum: int  # the most that may be written, in counts
    default: int | None  # in counts; None where the servo measures or decides it
    unit: str  # as in the maker's manual
    scale: float  # one count, in this unit
    sign_bit: int = 0  # which bit is the sign of a number kept as size and sign; 0 for none

    @property
    def si(self) -> float:
        """What one count is in SI units (rad/s, rad/s^2, A, s, ...; a pulse stays a pulse)."""
        return self.scale * SI_UNITS[self.unit]

    @property
    def largest(self) -> int:
        """The largest size of what may be written, in counts: without the sign bit."""
        return self.maximum & ((1 << self.sign_bit) - 1) if self.sign_bit else self.maximum

    @property
    def least(self) -> int:
        """The lowest number that may be written, in counts."""
        return -self.largest if self.sign_bit else self.minimum

    def raw(self, value: int) -> bytes:
        """The bytes of a count, whatever the range."""
        if value < 0 and self.sign_bit:
            value = -value | 1 << self.sign_bit
        return value.to_bytes(self.length, "little", signed=self.signed)

    def decode(self, data: bytes) -> int:
        """The count that these `length` bytes hold."""
        count = int.from_bytes(data, "little", signed=self.signed)
        if self.sign_bit and count >> self.sign_bit & 1:
            return -(count & (1 << self.sign_bit) - 1)
        return count

    def encode(self, value: int) -> bytes:
        """The bytes of a count; raises ValueError if it is outside the register's range."""
        if not self.least <= value <= self.maximum:
            raise ValueError(f"{self.name} takes {self.least} to {self.maximum}, not {value}")
        return self.raw(value)


def decode_block(registers: Iterable[Register], data: bytes, start: int) -> dict[str, int]:
    """The counts of registers, by name, in the bytes of a control table from an address on."""
    return {one.name: one.decode(data[one.address - start :][: one.length]) for one in registers}
