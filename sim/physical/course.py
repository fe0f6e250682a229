"""What a robot is to follow, a carried motion in knots; and simulations of it side by side."""

from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.rollout import Rollout

from controller.motion.rotations import Array, conjugate, from_rotation_vector, multiply, to_rotation_vector
from motiondeck_base.errors import MotiondeckError
from sim.physics.feedback import STEP
from sim.physics.physics_model import lead_of
from sim.robots.joint_motion import JointMotion
from sim.robots.robot import Robot
from sim.robots.training_files import velocities


class Batch:
    """Simulations of a model with a free root and otherwise hinges and slides."""

    def __init__(self, model: mujoco.MjModel, threads: int) -> None:
        """Args: the model, whose timestep divides STEP; the number of threads."""
        self.model = model
        self._pool, self._data = Rollout(nthread=threads), [mujoco.MjData(model) for _ in range(threads)]
        self._width = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self._held = max(1, round(STEP / model.opt.timestep))

    def __call__(self, states: Array, controls: Array) -> Array:
        """The states (B, K, n) after each of K knots of controls (B, K, S, nu), each held for STEP seconds."""
        width, (count, _, steps, joints) = self.model.nq + self.model.nv, controls.shape
        full = np.zeros((count, self._width))
        full[:, 1 : 1 + width] = states  # after the time
        held = np.repeat(controls.reshape(count, -1, joints), self._held, axis=1)
        found, _ = self._pool.rollout(self.model, self._data, full, held)
        last, after = steps * self._held, np.asarray(found, np.float64)
        return after[:, last - 1 :: last, 1 : 1 + width]

    def difference(self, start: Array, end: Array) -> Array:
        """The differences (..., 2 nv) from states (..., n) to others."""
        nq = self.model.nq
        start, end = np.broadcast_arrays(start, end)
        turn, change = to_rotation_vector(multiply(conjugate(start[..., 3:7]), end[..., 3:7])), end - start
        return np.concatenate([change[..., :3], turn, change[..., 7:nq], change[..., nq:]], axis=-1)

    def moved(self, states: Array, changes: Array) -> Array:
        """States (..., n) changed by differences (..., 2 nv)."""
        nq, nv = self.model.nq, self.model.nv
        shape = np.broadcast_shapes(states.shape[:-1], changes.shape[:-1])
        states, changes = (np.broadcast_to(array, (*shape, array.shape[-1])) for array in (states, changes))
        turned = multiply(states[..., 3:7], from_rotation_vector(changes[..., 3:6]))
        rest = states[..., 7:nq] + changes[..., 6:nv], states[..., nq:] + changes[..., nv:]
        return np.concatenate([states[..., :3] + changes[..., :3], turned, *rest], axis=-1)


KNOT = 0.02  # s for which offsets are held
# Standard deviations of the Gaussian over places of a carried motion and over the velocities of its root, s: the root
# of a frame follows from the foot that stands, and jumps by millimetres where the feet change.
PLACES, SPEEDS = 0.01, 0.05


@dataclass(frozen=True)
class CarriedCourse:
    """T knots of a carried motion of J joints."""

    states: Array  # shape (T, n), as of `Batch`
    targets: Array  # of the joints, shape (T, J), rad
    controls: Array  # of their servos in each STEP of a knot, shape (T, S, J), rad
    lower: Array  # least offsets that leave targets within their ranges, shape (T, J), rad
    upper: Array  # largest ones


def course_of(robot: Robot, model: mujoco.MjModel, motion: JointMotion) -> CarriedCourse:
    """The course of a motion at 1 / KNOT Hz, on a simulated model of the robot.

    MotiondeckError if a joint of the robot is a ball, or the motion has fewer than two frames.
    """
    if len(robot.layout.ball):
        raise MotiondeckError(f"{robot.name}: its ball joints cannot be searched; give a robot of hinges")
    if len(motion) < 2:
        raise MotiondeckError(f"{motion.name}: one frame is no motion to search; it needs two")
    targets, qpos, slow = _smooth(motion.angles, PLACES), _smooth(motion.qpos, PLACES), _smooth(motion.qpos, SPEEDS)
    for path in (qpos, slow):
        path[:, 3:7] /= np.linalg.norm(path[:, 3:7], axis=1, keepdims=True)
    speeds = velocities(robot.model, qpos, motion.rate)
    speeds[:, :6] = velocities(robot.model, slow, motion.rate)[:, :6]
    states = np.hstack([qpos, speeds])
    rate: Array = np.gradient(targets, KNOT, axis=0)  # pyright: ignore[reportAssignmentType]
    ahead = targets + lead_of(model) * rate
    steps = round(KNOT / STEP)
    share = ((np.arange(steps) + 0.5) / steps)[:, None]
    controls = (1.0 - share) * ahead[:, None] + share * np.concatenate([ahead[1:], ahead[-1:]])[:, None]
    lower, upper = robot.limits.lower - targets, robot.limits.upper - targets
    return CarriedCourse(states, targets, controls, np.minimum(lower, 0.0), np.maximum(upper, 0.0))


def played(batch: Batch, course: CarriedCourse, start: Array, first: int, offsets: Array) -> Array:
    """Plays H knots from knot `first` on, B times at once: states (B, H + 1, n), for offsets (B, H, J) of the targets.

    `start` are the first states, shape (B, n) or (n,).
    """
    count, knots, _ = offsets.shape
    here = slice(first, first + knots)
    given = np.clip(offsets, course.lower[here], course.upper[here])
    starts = np.broadcast_to(start, (count, start.shape[-1]))
    after = batch(starts, course.controls[here] + given[:, :, None])
    return np.concatenate([starts[:, None], after], axis=1)


def _smooth(values: Array, seconds: float) -> Array:
    """Values (T, C) at the knots under a Gaussian, mirrored through their ends so that these stay."""
    deviation = seconds / KNOT
    reach = min(int(4.0 * deviation) + 1, len(values) - 1)
    weight = np.exp(-0.5 * (np.arange(-reach, reach + 1) / deviation) ** 2)
    before, after = 2.0 * values[:1] - values[reach:0:-1], 2.0 * values[-1:] - values[-2 : -reach - 2 : -1]
    padded = np.concatenate([before, values, after])
    return np.stack([np.convolve(row, weight / weight.sum(), "valid") for row in padded.T], axis=1)
