"""Series: what sets the servos of one apart. Everything outside the control tables asks a property of these."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from hardware.families.family import Family

BAUD_RATES = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000, 6_000_000, 10_500_000)
"""Bits/s, by the value of the baud rate register of a Protocol 2.0 servo."""
VOLTAGE, HEAT, ENCODER, SHOCK, OVERLOAD = 1, 4, 8, 16, 32  # the usual problems


@dataclass(frozen=True, slots=True)
class Series:
    """The servos of one series."""

    name: str  # as in the rows of its family
    family: Family  # what they have in common with other series
    # In bits/s, by the value of the baud rate register.
    baud_rates: Mapping[int, int] = field(default_factory=lambda: MappingProxyType(dict(enumerate(BAUD_RATES))))
    # In bits/s; a value v that is not in `baud_rates` means baud_base / (v + 1). 0 for no such value.
    baud_base: float = 0.0
    # The bits that they report of the usual problems (see `describe_errors`), in their own order.
    problems: Mapping[int, int] = field(
        default_factory=lambda: MappingProxyType({bit: bit for bit in (VOLTAGE, HEAT, ENCODER, SHOCK, OVERLOAD)})
    )
    bulk_reads: bool = True  # whether one request may read several of them
    reboots: bool = True  # whether an instruction restarts them
    shuts_down_by: Literal["torque_enable", "torque_limit"] = "torque_enable"  # the register that a shutdown sets to 0
    checks_profiles: bool = False  # whether a profile beyond the velocity or acceleration limit is refused
    # The firmware from which the indirect data cells are some bytes earlier, and how many; or None.
    cells_moved: tuple[int, int] | None = None
    follows: bool = False  # whether drive mode bit 1 makes one the follower of another
    modes: tuple[int, ...] = ()  # the operating modes; () for those of a servo with, or without, a current measurement
    current_limited: tuple[int, ...] = (5,)  # the modes in which the goal current limits the current
    full_pwm: float = 885.0  # the count of PWM that means full voltage
    gain_unit: float = 128.0  # the position P gain with which a pulse of error is one count of PWM
    offset_subtracts: bool = False  # whether a homing offset is taken from a position, and not added to it
    wraps: bool = False  # whether a position begins anew after a turn also where torque is off
    # Bits that a register must have for its counts to mean what the table says: mask and value.
    bits_needed: Mapping[str, tuple[int, int]] = field(default_factory=dict)

    def baud_of(self, value: int) -> int | None:
        """The baud rate that a value of the register means, bits/s."""
        return self.baud_rates.get(value) or (round(self.baud_base / (value + 1)) or None)

    def usual_problems(self, bits: int) -> int:
        """Their own problem bits as the usual ones."""
        return sum(usual for usual, own in self.problems.items() if bits & own)

    def own_problems(self, bits: int) -> int:
        """The inverse of `usual_problems`, without those that they do not report."""
        return sum(own for usual, own in self.problems.items() if bits & usual)
