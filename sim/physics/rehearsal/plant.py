"""Plant: one robot in several variations, whose servos `mujoco.rollout` can simulate many times at once.

A rollout takes controls and no code, so the line between torque and speed of a servo,

    -T (1 + v / w) <= torque <= T (1 - v / w),      torque wanted  x = kp (target - position) + kv (rate - v)

is written as a motor with the constant limits T and a friction T / w:  torque = clip(x + T v / w, -T, T) - T v / w.
That is the same, but for a servo that brakes, which is let push harder than T.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco import rollout

from controller.motion.rotations import Array, from_rotation_vector, multiply
from sim.models.servo_motor import strength
from sim.models.surface import LowestPoint
from sim.physics.physics_model import lead_of, physics_model
from sim.physics.played_motions import DT
from sim.robots.robot import Robot

# What is tried is simulated in steps so much longer than what is done: they cost half as much.
COARSER = 2

_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


@dataclass(frozen=True)
class Variation:
    """What differs from the robot's files.

    Attributes:
        strength: of the servos, a share.
        friction: of the floor, a share.
        off: how far joints and root are turned from their places at the start, standard deviation, rad.
        seed: of these errors.
    """

    strength: float = 1.0
    friction: float = 1.0
    off: float = 0.0
    seed: int = 0

    def start(self, robot: Robot, qpos: Array) -> Array:
        """A posture (nq,) with these errors."""
        random, placed = np.random.default_rng(self.seed), qpos.copy()
        targets = np.empty(len(robot.joints))
        robot.layout.read(qpos, near=robot.rest, out=targets)
        targets += self.off * random.standard_normal(len(targets))
        robot.layout.place(np.clip(targets, robot.limits.lower, robot.limits.upper), placed)
        placed[3:7] = multiply(from_rotation_vector(self.off * random.standard_normal(3)), placed[3:7])
        return placed


def variations(count: int, seed: int, most: Variation) -> list[Variation]:
    """The robot as its files say, and others that are off by up to as much as one of them: weaker, and slipping."""
    random = np.random.default_rng(seed)
    drawn = [
        Variation(
            float(random.uniform(most.strength, 1.0)), float(random.uniform(most.friction, 1.0)), most.off, seed + k
        )
        for k in range(1, count)
    ]
    return [Variation(), *drawn]


class Plant:
    """P variations of one robot on a solid floor, with a free root, and where each of them is.

    Attributes:
        states: of MuJoCo, shape (P, S).
    """

    states: Array

    def __init__(self, robot: Robot, start: Array, threads: int) -> None:
        """Takes a robot, the posture that it starts from, shape (nq,), and how many threads simulate at once."""
        self._robot, self._start = robot, start
        self._model = model = physics_model(robot, "free")
        self._lead = lead_of(model)
        self._data = [mujoco.MjData(model) for _ in range(threads)]
        self._count = model.nq
        self._lowest = LowestPoint(model)
        # By default MuJoCo writes each warning to a file in the working directory.
        mujoco.set_mju_user_warning(lambda _: None)

    def put(self, varied: Sequence[Variation]) -> None:
        """Puts variations of the robot where it starts, on the floor."""
        self._fine = [_with_motors(self._robot, self._model, variation) for variation in varied]
        self._coarse = [copy.copy(one) for one in self._fine]
        for one in self._coarse:
            one.opt.timestep *= COARSER
        data = self._data[0]
        self.states = np.empty((len(varied), mujoco.mj_stateSize(self._model, _STATE)))
        for state, variation in zip(self.states, varied, strict=True):
            mujoco.mj_resetData(self._model, data)
            data.qpos[:] = variation.start(self._robot, self._start)
            mujoco.mj_kinematics(self._model, data)
            data.qpos[2] -= self._lowest(data)
            mujoco.mj_getState(self._model, data, state, _STATE)

    def tried(self, targets: Array, before: Array) -> Array:
        """What all variations would do, shape (N, P, H, nq), a sample DT apart; NaN from where one breaks.

        Args:
            targets: N courses of joint targets, shape (N, H, J), rad.
            before: the last targets, shape (J,), rad.
        """
        count, variations = len(targets), len(self.states)
        states = self._rolled(self._coarse, np.tile(self.states, (count, 1)), np.repeat(targets, variations, 0), before)
        return states[:, :, 1 : 1 + self._count].reshape(count, variations, -1, self._count)

    def advance(self, targets: Array, before: Array) -> Array:
        """Does it: targets (H, J), rad; where all variations went, shape (P, H, nq), NaN from where one breaks."""
        states = self._rolled(self._fine, self.states, np.repeat(targets[None], len(self.states), axis=0), before)
        self.states = states[:, -1].copy()
        return states[:, :, 1 : 1 + self._count]

    def _rolled(self, models: Sequence[mujoco.MjModel], states: Array, targets: Array, before: Array) -> Array:
        """The states (B, H, S) after each sample; the models take turns."""
        steps = round(DT / models[0].opt.timestep)
        turns = [models[k % len(models)] for k in range(len(states))]
        found, _ = rollout.rollout(turns, self._data, states, self._controls(targets, before, steps))
        after = np.asarray(found, np.float64)[:, steps - 1 :: steps]
        # MuJoCo puts a state that is no longer finite back to the start, time and all, where it would lie in peace.
        due = states[:, :1] + models[0].opt.timestep * steps * np.arange(1, after.shape[1] + 1)
        broken = np.abs(after[:, :, 0] - due) > 0.5 * models[0].opt.timestep
        after[np.logical_or.accumulate(broken, axis=1)] = np.nan
        return after

    def _controls(self, targets: Array, before: Array, steps: int) -> Array:
        """Of each step, shape (B, H steps, J): a target is reached evenly, and led by its rate as in `playback`."""
        from_where = np.concatenate([np.broadcast_to(before, targets[:, :1].shape), targets[:, :-1]], axis=1)
        change = targets - from_where
        share = (np.arange(steps) + 1.0)[:, None] / steps
        controls = (from_where + change * (self._lead / DT))[:, :, None] + change[:, :, None] * share
        return controls.reshape(len(targets), -1, targets.shape[-1])


def _with_motors(robot: Robot, plain: mujoco.MjModel, variation: Variation) -> mujoco.MjModel:
    """A variation of a model whose servos have their torque-speed line, in the form of a rollout."""
    model = copy.copy(plain)
    model.geom_friction[:, 0] *= variation.friction
    most = strength(model) * variation.strength
    if robot.servo is not None:
        slope = robot.servo.torque / robot.servo.speed
        most = np.minimum(most, robot.servo.most * variation.strength)
        model.actuator_biasprm[:, 2] += slope
        model.dof_damping[robot.layout.dof] += slope
    bounded = np.isfinite(most)
    model.actuator_forcelimited[bounded] = 1
    model.actuator_forcerange[bounded] = most[bounded, None] * (-1.0, 1.0)
    return model
