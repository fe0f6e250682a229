"""Simulated servos: torque limits, backlash and latency in each step, and statistics of load."""

from collections import deque
from collections.abc import Callable

import mujoco
import numpy as np

from controller.motion.rotations import Array
from sim.models.servo_motor import ROOM, Motors

_AT_THE_LIMIT = 0.999  # share of the present limit from which a servo counts as at its limit

_NOTES = 64  # steps buffered before the statistics are updated


class Servos:
    """One servo an actuator."""

    def __init__(self, motors: Motors, model: mujoco.MjModel, data: mujoco.MjData, dt: float) -> None:
        """Args: the servos; the simulated model, whose force ranges are overwritten, and its state; the tick, s."""
        self._motors, self._servo, self._model, self._data = motors, motors.servo, model, data
        # Views, made once and not in each step.
        self._velocity, self._force = data.actuator_velocity[:, None], data.actuator_force
        self._range = model.actuator_forcerange
        # The torque-speed line without ends lies between (-most, 0) and (0, most).
        most, none = motors.most, np.zeros(model.nu)
        self._floor, self._ceiling = np.column_stack([-most, none]), np.column_stack([none, most])
        model.actuator_forcelimited[:] = 1
        # The same line as  stall + slope velocity,  backwards and forwards.
        self._stall = motors.line(none)
        self._slope = motors.line(np.ones(model.nu)) - self._stall
        self._late, self._half_play = round(self._servo.latency / dt), 0.5 * self._servo.backlash
        self.start()

    def start(self) -> None:
        """Resets: cool servos, nothing on the bus."""
        joints = self._model.nu
        self._on_the_bus: deque[Array] = deque(maxlen=self._late + 1)
        self._steps = self._noted = 0
        self._square, self._peak = np.zeros(joints), np.zeros(joints)
        self._at_limit = np.zeros(joints, dtype=np.int64)
        self._forces, self._ranges = np.empty((_NOTES, joints)), np.empty((_NOTES, joints, 2))
        self._rows = [*self._ranges]

    def delayed(self, goal: Array) -> Array:
        """The goal sent `latency` ago; the first ones arrive at once."""
        self._on_the_bus.append(goal.copy())
        return self._on_the_bus[0]

    def step(self, advance: Callable[[mujoco.MjModel, mujoco.MjData], None]) -> None:
        """Advances with backlash in the goals and torque limits at the present speed; buffers limits and torques."""
        line, data = self._rows[self._noted], self._data
        np.multiply(self._velocity, self._slope, out=line)
        np.add(line, self._stall, out=line)
        np.maximum(line, self._floor, out=line)
        np.minimum(line, self._ceiling, out=line)
        self._range[...] = line
        if self._half_play > 0.0:
            error, half = data.ctrl - data.actuator_length, self._half_play
            data.ctrl -= np.minimum(np.maximum(error, -half), half)  # within the play there is no error
        advance(self._model, data)
        self._forces[self._noted] = self._force
        self._noted += 1
        self._steps += 1
        if self._noted == _NOTES:
            self._add_notes()

    def _add_notes(self) -> None:
        force = self._forces[: self._noted]
        low, high = (_AT_THE_LIMIT * self._ranges[: self._noted, :, end] for end in (0, 1))
        torque = np.abs(force)
        self._square += np.square(torque).sum(axis=0)
        np.maximum(self._peak, torque.max(axis=0, initial=0.0), out=self._peak)
        self._at_limit += (((force >= high) | (force <= low)) & (torque > 0.0)).sum(axis=0)
        self._noted = 0

    def report(self) -> dict[str, object]:
        """Statistics of load."""
        self._add_notes()
        servo, steps = self._servo, max(self._steps, 1)
        square = np.square(self._motors.drawn(np.sqrt(self._square / steps)))  # A^2, the mean of each servo
        seconds = self._steps * self._model.opt.timestep
        return {
            "peak_torque_nm": float(self._peak.max(initial=0.0)),
            "rms_current_a": float(np.sqrt(square.max(initial=0.0))),
            "at_limit": float((self._at_limit / steps).max(initial=0.0)),
            "hottest_degc": float(servo.temperature(square, seconds).max(initial=ROOM)),
        }
