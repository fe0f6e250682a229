"""What a robot is to follow: a carried motion in knots."""

from dataclasses import dataclass

import mujoco
import numpy as np

from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError
from sim.physical.batch import STEP, Batch
from sim.physics.physics_model import lead_of
from sim.robots.joint_motion import JointMotion
from sim.robots.robot import Robot
from sim.robots.training_files import velocities

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
