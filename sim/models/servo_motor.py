"""Servos: torque, current and temperature of a geared motor.

A direct-current motor gives its stall torque T at rest and nothing at its no-load speed w (in between, a straight
line), and draws a current in proportion to its torque:

    |torque| <= T (1 - |v| / w)  where it drives,   T  where it brakes,   and never beyond the current limit
    current = I_stall |torque| / T
    d temperature / dt = warming (current / I_stall)^2 - (temperature - room) / cooling

The gears have backlash, and the bus has latency.
"""

from __future__ import annotations

from typing import Annotated

import msgspec
import mujoco
import numpy as np

from controller.motion.rotations import Array

ROOM = 25.0  # temperature of the room, degC

_Positive = Annotated[float, msgspec.Meta(gt=0.0)]
_NotNegative = Annotated[float, msgspec.Meta(ge=0.0)]


class ServoMotor(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Data of a robot's servos; the table [servo] of a robot file."""

    torque: _Positive  # at stall, N m
    speed: _Positive  # without load, rad/s
    current: _Positive  # at stall, A
    current_limit: _Positive | None = None  # A; None for the stall current
    backlash: _NotNegative = 0.0  # from end to end, rad
    latency: _NotNegative = 0.0  # of targets, s
    warming: _Positive = 1.5  # by stall current, K/s, an estimate for a servo of 80 g
    cooling: _Positive = 240.0  # time constant towards the room's temperature, s, likewise
    hottest: _Positive = 80.0  # temperature of the shutdown, degC

    @property
    def most(self) -> float:
        """The torque that the current limit leaves, N m."""
        limit = self.current if self.current_limit is None else min(self.current_limit, self.current)
        return self.torque * limit / self.current

    def line(self, velocity: Array) -> Array:
        """The torque-speed line without its ends, backwards and forwards, shape (J, 2), N m."""
        return self.torque * (np.array([-1.0, 1.0]) - (velocity / self.speed)[:, None])

    def drawn(self, torque: Array) -> Array:
        """The current for torques of any shape, A."""
        return self.current / self.torque * np.abs(torque)

    def temperature(self, square: Array, seconds: float, start: float = ROOM) -> Array:
        """Temperature after some seconds at a mean square current (of any shape), A^2; degC."""
        settled = ROOM + self.cooling * self.warming * square / self.current**2
        return settled + (start - settled) * np.exp(-seconds / self.cooling)


def strength(model: mujoco.MjModel) -> Array:
    """Torque limits of a model's actuators, shape (J,), N m; inf without one."""
    limited = model.actuator_forcelimited.astype(bool)
    return np.where(limited, np.abs(model.actuator_forcerange).max(axis=1), np.inf)
