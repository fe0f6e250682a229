"""What a servo model's motor can do, which no control table says."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Motor:
    """A geared direct-current motor at 12 V.

    Attributes:
        no_load_speed: of the horn at full voltage, rev/min.
        stall_current: mA.
        full_pwm: the PWM count that means full voltage.
        lag: time constant with which the speed follows the voltage, s.
    """

    no_load_speed: float
    stall_current: float
    full_pwm: float
    lag: float


# Speed and current from the maker's data sheet; the lag is an estimate of rotor and gears without a load.
MOTORS = {"XM430-W350": Motor(no_load_speed=46.0, stall_current=2300.0, full_pwm=885.0, lag=0.015)}
"""Those of each model that can be emulated."""
