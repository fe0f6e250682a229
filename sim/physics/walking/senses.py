"""Senses: what a robot knows of itself, exactly, or from the angles of its joints and an inertial sensor in its trunk.

Nothing measures where the root is, and nothing needs to: the robot is seen from the feet that stand. They also tell how
fast the root moves, because a sole that stands has no speed, with the shares s_i of the feet that stand:

    v = - sum of  s_i (omega x r_i + J_i q')                                                                     (8)

with the gyroscope's omega, the sole r_i seen from the root, and the joints' speeds q'. A sole that has just landed
still moves, so v is what the accelerometer's a makes of it, and (8) draws it back within T = BLEND:

    v <- v + a dt,      v <- v + (1 - e^(-dt / T)) (v of (8) - v)                                                (9)

Posture x, the trunk's turn included, is followed the same way, so that its noise does not shake the robot: moved on by
the speeds x', then drawn back to what the angles and gravity say.

What it sees is `delay` old.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from controller.motion.rotations import Array, between, multiply, rotate

# How fast the legs correct what the accelerometer says, and angles and gravity what the speeds say, s.
BLEND = 0.1
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Sensors:
    """How well a robot measures; standard deviations of what differs from tick to tick, and constant errors.

    Attributes:
        angle: of a joint, rad.
        speed: of a joint, rad/s.
        tilt: of the trunk, rad.
        level: constant error of the trunk's tilt, forwards and to the left, rad.
        turn: of the trunk's angular velocity, rad/s.
        drift: constant error of the trunk's angular velocity, on each axis, rad/s.
        shake: of the trunk's acceleration, m/s^2.
        pull: constant error of the trunk's acceleration, on each axis, m/s^2.
        delay: how old a measurement is when it arrives, s.
        seed: of the noise.
    """

    angle: float = 0.0015
    speed: float = 0.05
    tilt: float = 0.003
    level: float = 0.005
    turn: float = 0.02
    drift: float = 0.01
    shake: float = 0.1
    pull: float = 0.05
    delay: float = 0.01
    seed: int = 0


class ExactState:
    """Sees the state as it is, from where gravity points down."""

    def __init__(self, model: mujoco.MjModel, gravity: Array) -> None:
        """Takes the robot's own model, and gravity, shape (3,), m/s^2, seen from the floor."""
        self.model, self._data = model, mujoco.MjData(model)
        self._upright = between(-gravity / np.linalg.norm(gravity), UP)

    def start(self) -> None:
        """Forgets what it saw before: the robot is at rest where it is seen next."""

    def see(self, data: mujoco.MjData, stands: Array) -> mujoco.MjData:
        """The robot as it knows itself: posture, bodies, centre of mass and its velocity.

        Args:
            data: the true state.
            stands: which feet stand, shares that sum to 1, shape (2,).
        """
        seen = self._data
        self._read(data.qpos, data.qvel)
        mujoco.mj_kinematics(self.model, seen)
        mujoco.mj_comPos(self.model, seen)
        mujoco.mj_comVel(self.model, seen)
        mujoco.mj_subtreeVel(self.model, seen)
        return seen

    def _read(self, qpos: Array, qvel: Array) -> None:
        seen, upright = self._data, self._upright
        seen.qpos[:], seen.qvel[:] = qpos, qvel
        seen.qpos[:3], seen.qpos[3:7] = rotate(upright, qpos[:3]), multiply(upright, qpos[3:7])
        seen.qvel[:3] = rotate(upright, qvel[:3])


class Estimate(ExactState):
    """Estimates the state from sensors."""

    def __init__(
        self,
        model: mujoco.MjModel,
        gravity: Array,
        sensors: Sensors,
        soles: Callable[[mujoco.MjData, int], tuple[Array, int]],
        dt: float,
    ) -> None:
        """Takes what an exact state does, and how it is measured.

        Args:
            model, gravity: as of `ExactState`.
            sensors: how well.
            soles: gives the middle of the sole of a foot in a state, and the foot's body.
            dt: from tick to tick, s.
        """
        super().__init__(model, gravity)
        self._sensors, self._soles = sensors, soles
        self._random = np.random.default_rng(sensors.seed)
        self._blend, self._dt, self._root_speed = 1.0 - float(np.exp(-dt / BLEND)), dt, np.zeros(3)
        self._pull = sensors.pull * self._random.choice([-1.0, 1.0], 3)
        self._line: deque[tuple[Array, Array, Array]] = deque(maxlen=round(sensors.delay / dt) + 2)
        side = self._random.uniform(0.0, 2.0 * np.pi)
        self._level = sensors.level * np.array([np.cos(side), np.sin(side), 0.0])
        self._drift = sensors.drift * self._random.choice([-1.0, 1.0], 3)
        self._jacobian, self._error = np.empty((3, model.nv)), np.empty(model.nv)
        self._posture: Array | None = None

    def start(self) -> None:
        """Forgets what it saw before; as of `ExactState`."""
        self._posture = None
        self._line.clear()
        self._root_speed[:] = 0.0

    def see(self, data: mujoco.MjData, stands: Array) -> mujoco.MjData:
        """The robot as its sensors show it; as of `ExactState`."""
        seen, s, random = self._data, self._sensors, self._random
        self._line.append((data.qpos.copy(), data.qvel.copy(), stands))
        before, (qpos, qvel, stands) = self._line[0], self._line[min(1, len(self._line) - 1)]
        self._read(before[0], before[1])
        last = seen.qvel[:3].copy()
        self._read(qpos, qvel)
        speed = self._root_speed
        speed += seen.qvel[:3] - last + self._dt * (self._pull + s.shake * random.standard_normal(3))
        off = s.angle * random.standard_normal(self.model.nv)
        off[:3], off[3:6] = 0.0, self._level + s.tilt * random.standard_normal(3)
        mujoco.mj_integratePos(self.model, seen.qpos, off, 1.0)
        seen.qvel[6:] += s.speed * random.standard_normal(self.model.nv - 6)
        seen.qvel[3:6] += self._drift + s.turn * random.standard_normal(3)
        seen.qpos[:3], seen.qvel[:3] = 0.0, 0.0
        self._follow(seen)
        mujoco.mj_kinematics(self.model, seen)
        mujoco.mj_comPos(self.model, seen)
        by_legs = np.zeros(3)
        for foot, share in enumerate(stands):
            sole, body = self._soles(seen, foot)
            mujoco.mj_jac(self.model, seen, self._jacobian, None, sole, body)
            by_legs -= share * (self._jacobian[:, 3:] @ seen.qvel[3:])
        speed += self._blend * (by_legs - speed)
        seen.qvel[:3] = speed
        mujoco.mj_comVel(self.model, seen)
        mujoco.mj_subtreeVel(self.model, seen)
        return seen

    def _follow(self, seen: mujoco.MjData) -> None:
        """Smooths a measured posture with its speeds; the first one is taken as it is."""
        if self._posture is None:
            self._posture = seen.qpos.copy()
        mujoco.mj_integratePos(self.model, self._posture, seen.qvel, self._dt)
        mujoco.mj_differentiatePos(self.model, self._error, 1.0, self._posture, seen.qpos)
        mujoco.mj_integratePos(self.model, self._posture, self._error, self._blend)
        seen.qpos[:] = self._posture
