"""The physical stage: a carried motion as a robot does it on its own feet, or the second at which it falls.

The robot starts in the motion's first posture, at its speed, and is simulated with a timestep of STEP seconds. Its
torque limits hold; lines of torque and speed, backlash and latency of servos are left out.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from controller.motion.rotations import Array
from sim.physical.course import KNOT, STEP, Batch, CarriedCourse, course_of, played
from sim.physical.search import AHEAD, BEGINS, MOVES, Sampling, Search
from sim.physics.physics_model import physics_model
from sim.physics.recovery import has_fallen
from sim.robots.joint_motion import JointMotion
from sim.robots.robot import Robot

RATE = 1.0 / KNOT  # of the motions, Hz
Planner = Callable[[Batch, CarriedCourse], Search]
PLANNERS: tuple[Planner, ...] = (Search, Sampling)
STARTS = 0.001  # standard deviation of the first positions beside the motion's, m and rad


@dataclass(frozen=True)
class OnItsFeet:
    """What a robot did of a motion, to its end or to its fall."""

    motion: JointMotion
    states: Array  # at each knot, shape (T, n), as of `Batch`
    targets: Array  # of the joints at each knot, shape (T, J), rad
    fell_s: float | None  # time of the fall; None if it stands to the end
    path_m: float  # mean distance of the root from that of the carried motion, along the ground
    pose_deg: float  # root mean square of the joints' differences from the carried ones


class PhysicalStage:
    """A robot and a motion that was carried to it at RATE."""

    def __init__(self, robot: Robot, motion: JointMotion, threads: int | None = None) -> None:
        """MotiondeckError for a motion or a robot as of `course_of`; by default a thread a core."""
        model, strength = physics_model(robot, "free"), robot.strength
        limited = np.isfinite(strength)
        model.actuator_forcelimited[limited] = 1
        model.actuator_forcerange[limited] = np.stack([-strength, strength], axis=1)[limited]
        model.opt.timestep = STEP
        mujoco.set_mju_user_warning(lambda _: None)  # a robot that a try throws far writes no file of warnings
        self.batch, self._robot, self._motion = Batch(model, threads or os.cpu_count() or 1), robot, motion
        self.course = course_of(robot, model, motion)

    def search(
        self, seed: int = 0, progress: Callable[[float], None] = lambda seconds: None, planner: Planner = Search
    ) -> OnItsFeet:
        """Looks for the offsets, knot by knot, until the motion ends or the robot falls.

        `seed` chooses by how little the robot starts beside the motion; `progress` gets the seconds done.
        `planner` makes another search.
        """
        course, batch = self.course, self.batch
        search, knots, now = planner(batch, course), len(course.states), 0
        start = np.random.default_rng(seed).normal(0.0, np.repeat([STARTS, 0.0], batch.model.nv))
        states, fell = batch.moved(course.states[:1], start), None
        for ahead in range(BEGINS, AHEAD, MOVES):
            search.improve(states[0], 0, ahead)
        while now < knots - 1 and fell is None:
            search.improve(states[-1], now, AHEAD)
            after = min(now + MOVES, knots - 1)
            new = played(batch, course, states[-1], now, search.offsets[None, now:after])[0]
            states, fell, now = np.concatenate([states, new[1:]]), self.fallen(new[1:], now + 1), after
            progress(now * KNOT)
        count, nq, nv = len(states), self._robot.model.nq, self._robot.model.nv
        off, angles = batch.difference(course.states[:count], states), np.empty((count, len(self._robot.joints)))
        for state, row in zip(states, angles, strict=True):
            self._robot.layout.read(state, near=row, out=row)
        motion = JointMotion(self._motion.name, self._motion.joints, RATE, angles, states[:, :nq].copy())
        targets = course.targets[:count] + np.clip(search.offsets[:count], course.lower[:count], course.upper[:count])
        path, pose = np.hypot(off[:, 0], off[:, 1]).mean(), np.sqrt(np.square(off[:, 6:nv]).mean())
        return OnItsFeet(motion, states, targets, fell, float(path), float(np.degrees(pose)))

    def best(
        self,
        seed: int = 0,
        progress: Callable[[float], None] = lambda seconds: None,
        planners: tuple[Planner, ...] = PLANNERS,
    ) -> OnItsFeet:
        """What the first planner finds that stands to the end, or the one that stands longest."""
        tried: list[OnItsFeet] = []
        for planner in planners:
            tried.append(self.search(seed, progress=progress, planner=planner))
            if tried[-1].fell_s is None:
                return tried[-1]
        return max(tried, key=lambda one: len(one.motion))

    def plain(self) -> float | None:
        """The second at which the robot falls with the motion's targets alone, or None."""
        course, none = self.course, np.zeros((1, *self.course.targets[1:].shape))
        return self.fallen(played(self.batch, course, course.states[0], 0, none)[0], 0)

    def fallen(self, states: Array, knot: int) -> float | None:
        """The second at which a robot in states (K, n) from a knot on has fallen, beside the course; or None."""
        standing, rows = self._robot.model.qpos0[3:7], zip(states, self.course.states[knot:], strict=False)
        fallen = (at for at, (here, asked) in enumerate(rows, knot) if has_fallen(here, asked, standing))
        return next((at * KNOT for at in fallen), None)
