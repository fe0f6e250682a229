"""State estimation: the exact state, or an estimate from joint angles and an inertial sensor in the trunk.

The root's place is not measured: the robot is seen from the standing feet. As a standing sole has no speed, they also
give the root's velocity, with their shares s_i of the weight:

    v = - sum of  s_i (omega x r_i + J_i q')                                                                     (8)

with the gyroscope's omega, the sole r_i seen from the root, and the joints' speeds q'. A sole that has just landed
still moves, so v is what the accelerometer's a makes of it, and (8) draws it back within T = BLEND:

    v <- v + a dt,      v <- v + (1 - e^(-dt / T)) (v of (8) - v)                                                (9)

The posture, with the trunk's turn, is filtered in the same way: integrated from the speeds, then drawn back to angles
and gravity. Measurements arrive after `delay`.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from controller.motion.rotations import Array, between, multiply, rotate

# Time constant of the corrections of (9) and of the posture, s.
BLEND = 0.1
UP = np.array([0.0, 0.0, 1.0])
SoleOf = Callable[[mujoco.MjData, int], tuple[Array, int]]  # the middle of a foot's sole in a state, with its body


@dataclass(frozen=True)
class Sensors:
    """Errors of a robot's sensors: standard deviations of noise, and constant errors."""

    angle: float = 0.0015  # of a joint, rad
    speed: float = 0.05  # of a joint, rad/s
    tilt: float = 0.003  # of the trunk, rad
    level: float = 0.005  # constant error of the trunk's tilt, forwards and to the left, rad
    turn: float = 0.02  # of the trunk's angular velocity, rad/s
    drift: float = 0.01  # constant error of the trunk's angular velocity, on each axis, rad/s
    shake: float = 0.1  # of the trunk's acceleration, m/s^2
    pull: float = 0.05  # constant error of the trunk's acceleration, on each axis, m/s^2
    delay: float = 0.01  # age of a measurement when it arrives, s
    seed: int = 0  # of the noise


class ExactState:
    """The exact state, in a frame in which gravity points down."""

    def __init__(self, model: mujoco.MjModel, gravity: Array) -> None:
        """Args: the robot's own model; gravity in the frame of the floor, shape (3,), m/s^2."""
        self.model, self._data = model, mujoco.MjData(model)
        self._upright = between(-gravity / np.linalg.norm(gravity), UP)

    def start(self) -> None:
        """Resets: the robot is next seen at rest."""

    def see(self, data: mujoco.MjData, stands: Array) -> mujoco.MjData:
        """Posture, centre of mass and its velocity, from the true state and the feet's shares (2,) of the weight."""
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

    def __init__(self, model: mujoco.MjModel, gravity: Array, sensors: Sensors, soles: SoleOf, dt: float) -> None:
        """Args: as of `ExactState`; sensors; the soles; the tick, s."""
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
        self._posture = None
        self._line.clear()
        self._root_speed[:] = 0.0

    def see(self, data: mujoco.MjData, stands: Array) -> mujoco.MjData:
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
        """Filters a measured posture by its speeds; the first one passes."""
        if self._posture is None:
            self._posture = seen.qpos.copy()
        mujoco.mj_integratePos(self.model, self._posture, seen.qvel, self._dt)
        mujoco.mj_differentiatePos(self.model, self._error, 1.0, self._posture, seen.qpos)
        mujoco.mj_integratePos(self.model, self._posture, self._error, self._blend)
        seen.qpos[:] = self._posture
