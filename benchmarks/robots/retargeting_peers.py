"""Retargeting as others do it, with mink (pip install mink): on any calibrated robot, root and joints of a pose.

General Motion Retargeting (Araujo et al. 2025, arXiv 2510.02252) with its weights for the Unitree G1: the human's
points are scaled from its pelvis, two stages of inverse kinematics bring the robot's bodies first to their
orientations, then to points and orientations. Its tables of scales and of how each body is turned to its bone, made by
hand for each robot, are made here from the robot's lengths and its rest pose.
"""

# pyright: reportMissingImports=false
# (mink need not be installed.)

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from controller.motion.anatomy import Part, Side, anatomy
from controller.motion.rotations import Array, between, conjugate, multiply
from controller.motion.skeleton import ROOT, Pose, Skeleton
from sim.retargeting.human_limbs import LIMBS, LimbView
from sim.retargeting.robot_limbs import RobotLimbs
from sim.robots.calibrate import standing_human
from sim.robots.robot import Robot

# Costs of position and orientation in the first and in the second stage.
STAGES = (
    {"pelvis": (100, 10), "foot": (100, 10)} | dict.fromkeys(("thigh", "shank", "chest", "arm"), (0, 10)),
    {"pelvis": (100, 5), "foot": (100, 50), "chest": (0, 10)} | dict.fromkeys(("thigh", "shank", "arm"), (10, 5)),
)
DAMPING, LM_DAMPING, SPEED = 0.5, 1.0, 3.0 * np.pi
ENOUGH, MOST_STEPS = 0.001, 10
FIRST_ROUNDS = 40  # poses given over and over before the first answer: it starts from zero

_BONES: dict[str, Part] = {
    "thigh": "thigh",
    "shank": "shank",
    "foot": "foot",
    "upper_arm": "upper arm",
    "forearm": "forearm",
    "hand": "hand",
}
_SIDES: dict[str, Side] = {"r": "right", "l": "left"}


class _Targets:
    """Where the bodies of a robot ought to be and how they ought to be turned, for the poses of one skeleton.

    Attributes:
        bodies: part to body.
    """

    def __init__(self, robot: Robot, parts: Mapping[str, str], limbs: RobotLimbs, skeleton: Skeleton) -> None:
        self._skeleton, self._path_scale = skeleton, robot.path_scale
        length = LimbView(skeleton).length
        arm = limbs.reach.get("r_arm", 0.0) / float(length[LIMBS.index("r_upper_arm") :][:2].sum())
        limbs.place(robot.rest)
        stands = standing_human()
        self.bodies: dict[str, str] = {}
        self._rows: dict[str, tuple[int, int, Array, float]] = {}
        for part, body in parts.items():
            bone = _bone(skeleton, part)
            if bone is None:
                continue
            turn = np.array([1.0, 0.0, 0.0, 0.0])
            way = part.replace("hand", "forearm")  # hands hang as the forearms do
            if way in LIMBS and not part.endswith("foot"):
                turn = between(skeleton.rest_direction[bone], stands[LIMBS.index(way)])
            own = limbs.data.xquat[robot.model.body(body).id]
            start = ROOT if bone == ROOT else int(skeleton.parent[bone])
            scale = arm if part[2:] in ("upper_arm", "forearm", "hand") else robot.path_scale
            self.bodies[part] = body
            self._rows[part] = (bone + 1, start + 1, multiply(conjugate(turn), own), scale)

    def __call__(self, pose: Pose) -> dict[str, tuple[Array, Array]]:
        """Part to place (3,), m, and quaternion (4,)."""
        joints, root = self._skeleton.joints(pose.root_position, pose.rotation), pose.root_position
        return {
            part: (self._path_scale * root + scale * (joints[start] - root), multiply(pose.rotation[bone], turn))
            for part, (bone, start, turn, scale) in self._rows.items()
        }


def _bone(skeleton: Skeleton, part: str) -> int | None:
    """The bone of a part such as "r_upper_arm"; none if the skeleton or the method has no use for it."""
    found = anatomy(skeleton)
    if part == "pelvis":
        return ROOT
    if part == "chest":
        shoulder = found.first("clavicle", "right")
        shoulder = found.first("upper arm", "right") if shoulder is None else shoulder
        return None if shoulder is None else int(skeleton.parent[shoulder])
    return found.first(_BONES[part[2:]], _SIDES[part[0]]) if part[2:] in _BONES else None


class TwoStages:
    """General Motion Retargeting's method; qpos (nq,) of a pose."""

    def __init__(self, robot: Robot, parts: Mapping[str, str], limbs: RobotLimbs, skeleton: Skeleton) -> None:
        import mink

        self._mink: Any = mink
        self._targets = _Targets(robot, parts, limbs, skeleton)
        self._start = _start(robot)
        self._configuration = mink.Configuration(robot.model)
        self._stages = [
            {
                part: mink.FrameTask(body, "body", *_cost(stage, part), lm_damping=LM_DAMPING)
                for part, body in self._targets.bodies.items()
            }
            for stage in STAGES
        ]
        self._limits = [
            mink.ConfigurationLimit(robot.model),
            mink.VelocityLimit(robot.model, dict.fromkeys(robot.joints, SPEED)),
        ]
        self._dt = float(robot.model.opt.timestep)
        self._rounds = FIRST_ROUNDS

    def __call__(self, pose: Pose) -> Array:
        """The robot (nq,) in a pose."""
        targets = self._targets(pose)
        if self._rounds == FIRST_ROUNDS:
            start = self._start.copy()
            start[:3], start[3:7] = targets["pelvis"]
            self._configuration.update(start)
        for stage in self._stages:
            for part, task in stage.items():
                place, turn = targets[part]
                task.set_target(self._mink.SE3.from_rotation_and_translation(self._mink.SO3(turn), place))
        for _ in range(self._rounds):
            for stage in self._stages:
                self._solve([*stage.values()])
        self._rounds = 1
        return self._configuration.q.copy()

    def _solve(self, tasks: list[Any]) -> None:
        before, step = self._error(tasks), 0
        while True:
            self._configuration.integrate_inplace(
                self._mink.solve_ik(self._configuration, tasks, self._dt, "daqp", damping=DAMPING, limits=self._limits),
                self._dt,
            )
            after = self._error(tasks)
            if not before - after > ENOUGH or step == MOST_STEPS:
                return
            before, step = after, step + 1

    def _error(self, tasks: list[Any]) -> float:
        return float(np.linalg.norm(np.concatenate([task.compute_error(self._configuration) for task in tasks])))


class OneStage:
    """Plain mink: points of knees, ankles, elbows and wrists, pelvis, chest and feet, a posture; one step a frame."""

    def __init__(
        self, robot: Robot, parts: Mapping[str, str], limbs: RobotLimbs, skeleton: Skeleton, dt: float
    ) -> None:
        import mink

        self._mink: Any = mink
        self._targets, self._dt = _Targets(robot, parts, limbs, skeleton), dt
        self._start = _start(robot)
        self._configuration = mink.Configuration(robot.model)
        costs = {"pelvis": (10.0, 10.0), "foot": (1.0, 1.0), "chest": (0.0, 1.0), "thigh": (0.0, 0.0)}
        self._tasks = {
            part: mink.FrameTask(
                body,
                "body",
                *costs.get(part.removeprefix("r_").removeprefix("l_"), (1.0, 0.0)),
                lm_damping=1e-3,
            )
            for part, body in self._targets.bodies.items()
        }
        self._posture = mink.PostureTask(robot.model, cost=1e-2)
        self._posture.set_target(self._start)
        speeds = dict(zip(robot.joints, robot.limits.velocity.tolist(), strict=True))
        self._limits = [mink.ConfigurationLimit(robot.model), mink.VelocityLimit(robot.model, speeds)]
        self._rounds = 100

    def __call__(self, pose: Pose) -> Array:
        """The robot (nq,) in a pose."""
        targets = self._targets(pose)
        if self._rounds > 1:
            start = self._start.copy()
            start[:3], start[3:7] = targets["pelvis"]
            self._configuration.update(start)
        for part, task in self._tasks.items():
            place, turn = targets[part]
            task.set_target(self._mink.SE3.from_rotation_and_translation(self._mink.SO3(turn), place))
        for _ in range(self._rounds):
            velocity = self._mink.solve_ik(
                self._configuration, [*self._tasks.values(), self._posture], self._dt, "daqp", limits=self._limits
            )
            self._configuration.integrate_inplace(velocity, self._dt)
        self._rounds = 1
        return self._configuration.q.copy()


def _start(robot: Robot) -> Array:
    """The robot at rest, shape (nq,)."""
    qpos = mujoco.MjData(robot.model).qpos.copy()
    robot.layout.place(robot.rest, qpos)
    return qpos


def _cost(stage: Mapping[str, tuple[int, int]], part: str) -> tuple[float, float]:
    name = part.removeprefix("r_").removeprefix("l_")
    position, orientation = stage["arm" if name in ("upper_arm", "forearm", "hand") else name]
    return float(position), float(orientation)
