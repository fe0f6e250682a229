"""What a servo model's motor can do, which no control table says."""

from __future__ import annotations

from dataclasses import dataclass

from hardware.control_table.servo_traits import TRAITS
from hardware.errors import RigError

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


def motor_of(model: str) -> Motor:
    """The motor of a model.

    Raises:
        RigError: if the model cannot be emulated.
    """
    traits = TRAITS.get(model)
    if traits is None:
        raise RigError(f"{model} cannot be emulated: known are the X and MX series ({', '.join(TRAITS)}).")
    return Motor(traits.no_load_speed, traits.stall_current * 1e3, traits.voltage)
