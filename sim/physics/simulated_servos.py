"""The servos of a simulated robot at work: their limits, play and delay in each step, and what they have drawn."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

from collections import deque

import mujoco
import numpy as np

from controller.rotations import Array
from sim.models.servo_motor import ROOM, ServoMotor

# A servo that pushes with this share of its present limit counts as at its limit.
_AT_THE_LIMIT = 0.999


class Servos:
    """One servo an actuator.

    Args:
        servo: what each can do.
        model: whose actuators they are; the ranges of its forces become theirs, step by step.
        dt: how much time passes between two targets, s.
    """

    def __init__(self, servo: ServoMotor, model: mujoco.MjModel, dt: float) -> None:
        self._servo, self._model = servo, model
        own = model.actuator_forcerange.copy()
        own[~model.actuator_forcelimited.astype(bool)] = (-np.inf, np.inf)
        # The torque-speed line without ends lies between (-most, 0) and (0, most), and within what the model allows.
        most = servo.most
        self._floor = np.column_stack([np.maximum(-most, own[:, 0]), np.minimum(0.0, own[:, 1])])
        self._ceiling = np.column_stack([np.maximum(0.0, own[:, 0]), np.minimum(most, own[:, 1])])
        model.actuator_forcelimited[:] = 1
        self._late = round(servo.latency / dt)
        self.start()

    def start(self) -> None:
        """Begins anew with cool servos and nothing on the bus."""
        joints = self._model.nu
        self._on_the_bus: deque[Array] = deque(maxlen=self._late + 1)
        self._steps = 0
        self._square, self._peak = np.zeros(joints), np.zeros(joints)
        self._at_limit = np.zeros(joints, dtype=np.int64)

    def delayed(self, goal: Array) -> Array:
        """The goal that arrives at the servos when this one is sent, `latency` later; the first ones arrive at once."""
        self._on_the_bus.append(goal.copy())
        return self._on_the_bus[0]

    def limit(self, data: mujoco.MjData) -> None:
        """Sets the torque limits at the present speed, and applies the backlash to the goals."""
        line = self._servo.line(data.actuator_velocity)
        np.maximum(line, self._floor, out=line)
        np.minimum(line, self._ceiling, out=self._model.actuator_forcerange)
        if self._servo.backlash > 0.0:
            error = data.ctrl - data.actuator_length
            half = 0.5 * self._servo.backlash
            data.ctrl[:] = data.actuator_length + np.sign(error) * np.maximum(np.abs(error) - half, 0.0)

    def note(self, data: mujoco.MjData) -> None:
        """Adds the torques of the last step to the statistics."""
        force, share = data.actuator_force, _AT_THE_LIMIT * self._model.actuator_forcerange
        torque = np.abs(force)
        self._steps += 1
        self._square += torque * torque
        np.maximum(self._peak, torque, out=self._peak)
        self._at_limit += ((force >= share[:, 1]) | (force <= share[:, 0])) & (torque > 0.0)

    @property
    def mean_square_current(self) -> Array:
        """Of each servo since the start, shape (J,), A^2."""
        return np.square(self._servo.drawn(np.sqrt(self._square / max(self._steps, 1))))

    @property
    def at_limit(self) -> Array:
        """The share of the time in which each servo was at its torque limit, shape (J,)."""
        return self._at_limit / max(self._steps, 1)

    def report(self) -> dict[str, object]:
        """The load of the servos, for the report."""
        servo, square = self._servo, self.mean_square_current
        seconds = self._steps * self._model.opt.timestep
        return {
            "peak_torque_nm": float(self._peak.max(initial=0.0)),
            "rms_current_a": float(np.sqrt(square.max(initial=0.0))),
            "at_limit": float(self.at_limit.max(initial=0.0)),
            "hottest_degc": float(servo.temperature(square, seconds).max(initial=ROOM)),
        }
