"""The motor data of servo models, which are in no control table."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hardware.control_table.servo_traits import TRAITS

_GEARS = 0.7  # share of an ideal motor's torque that is left behind the gears; an estimate
_LAG = 0.015  # s; an estimate of rotor and gears without a load
_WARMING = 1.5  # K/s at stall current; an estimate
_COOLING = 240.0  # s, the time constant towards the room's temperature; an estimate


@dataclass(frozen=True, slots=True)
class Motor:
    """A geared direct-current motor.

    Attributes:
        no_load_speed: of the horn at full voltage, rev/min.
        stall_current: mA.
        voltage: at which these hold, V.
        full_pwm: the PWM count that means full voltage.
        lag: time constant with which the speed follows the voltage, s.
        warming: how fast the stall current heats it, K/s.
        cooling: time constant with which it cools, s.
    """

    no_load_speed: float
    stall_current: float
    voltage: float = 12.0
    full_pwm: float = 885.0
    lag: float = _LAG
    warming: float = _WARMING
    cooling: float = _COOLING

    @property
    def stall_torque(self) -> float:
        """Of the horn at full voltage, N·m: an ideal motor's (stall power over no-load speed), less the gears'."""
        power = self.voltage * self.stall_current * 1e-3
        return _GEARS * power / (self.no_load_speed * 2.0 * math.pi / 60.0)


def motor_of(model: str) -> Motor:
    """The motor of a model that can be a joint of a rig."""
    traits = TRAITS[model]
    return Motor(traits.no_load_speed, traits.stall_current * 1e3, traits.voltage, traits.family.full_pwm)
