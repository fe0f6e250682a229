"""Servos: torque, current and temperature of a geared motor.

A direct-current motor gives its stall torque T at rest and nothing at its no-load speed w (in between, a straight
line), and draws a current in proportion to its torque:

    |torque| <= T (1 - |v| / w)  where it drives,   T  where it brakes,   and never beyond the current limit
    current = I_stall |torque| / T
    d temperature / dt = warming (current / I_stall)^2 - (temperature - room) / cooling

The gears have backlash, and the bus has latency.
"""

from dataclasses import dataclass
from typing import Annotated

import msgspec
import mujoco
import numpy as np

from controller.motion.rotations import Array

ROOM = 25.0  # temperature of the room, degC

Positive = Annotated[float, msgspec.Meta(gt=0.0)]
_NotNegative = Annotated[float, msgspec.Meta(ge=0.0)]


class ServoMotor(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Data of a robot's servos; the table [servo] of a robot file."""

    torque: Positive  # at stall, N m
    speed: Positive  # without load, rad/s
    current: Positive  # at stall, A
    current_limit: Positive | None = None  # A; None for the stall current
    backlash: _NotNegative = 0.0  # from end to end, rad
    latency: _NotNegative = 0.0  # of targets, s
    warming: Positive = 1.5  # by stall current, K/s, an estimate for a servo of 80 g
    cooling: Positive = 240.0  # time constant towards the room's temperature, s, likewise
    hottest: Positive = 80.0  # temperature of the shutdown, degC

    def temperature(self, square: Array, seconds: float, start: float = ROOM) -> Array:
        """Temperature after some seconds at a mean square current (of any shape), A^2; degC."""
        settled = ROOM + self.cooling * self.warming * square / self.current**2
        return settled + (start - settled) * np.exp(-seconds / self.cooling)


@dataclass(frozen=True)
class Motors:
    """The servos of J joints."""

    servo: ServoMotor  # the data that they share
    torque: Array  # at stall, shape (J,), N m
    speed: Array  # without load, shape (J,), rad/s
    allowed: Array  # torque limits of the model, shape (J,), N m

    @property
    def most(self) -> Array:
        """The torques that the current limit and the model leave, shape (J,), N m."""
        share = min(self.servo.current_limit or np.inf, self.servo.current) / self.servo.current
        return np.minimum(share * self.torque, self.allowed)

    def line(self, velocity: Array) -> Array:
        """The torque-speed lines without their ends, backwards and forwards, shape (J, 2), N m."""
        return self.torque[:, None] * (np.array([-1.0, 1.0]) - (velocity / self.speed)[:, None])

    def drawn(self, torque: Array) -> Array:
        """The currents for torques (..., J), A."""
        return self.servo.current / self.torque * np.abs(torque)


def strength(model: mujoco.MjModel) -> Array:
    """Torque limits of a model's actuators, shape (J,), N m; inf without one."""
    limited = model.actuator_forcelimited.astype(bool)
    return np.where(limited, np.abs(model.actuator_forcerange).max(axis=1), np.inf)
