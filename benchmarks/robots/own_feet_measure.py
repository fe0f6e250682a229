"""How long a walking robot stands, how it bends its knees and how it pushes off, beside the human.

Nothing here is shared with walking: a knee is the hinge by which a leg's length changes most, loads are the floor's
contact forces, a fall is judged by the root, and the human's joints come from the skeleton.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.motion.skeleton import Pose, Skeleton
from sim.models.feet import Foot
from sim.models.kinematic_tree import hinges_between, path_to
from sim.physics.playback import PhysicsPlayback
from sim.physics.walk_trial import Course, placed_pose
from sim.robots.robot import DT

Array = NDArray[np.float64]

GRAVITY = 9.81
# The ends of a leg's bones by the names of both kinds of skeletons; {} is the side.
BONES = (("{}hip", "{}hipjoint"), ("{}kne", "{}femur"), ("{}ank", "{}tibia"), ("{}foo", "{}foot"))
SLOW = 0.15  # of the ball of a foot that stands, legs a second
FELL_HEIGHT, FELL_TILT = 0.6, 0.8  # share of the first height, and rad, beyond which a robot has fallen
LOADED, CARRIES = 0.05, 0.8  # shares of the weight on a foot that touches, and on one that carries the robot
BEGUN = 4.0  # s, after which a walk is under way
LEAVING, AWAY = 0.1, 0.15  # before and after a foot leaves the floor, s


class HumanLegs:
    """Bends of the knees, pitches of the feet (toes down), rad, and which feet stand: right and left, tick by tick."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.rows: list[tuple[Array, Array, Array]] = []
        self._skeleton = skeleton
        self._points = [
            [1 + next(skeleton.index(n.format(s)) for n in names if n.format(s) in skeleton.bones) for names in BONES]
            for s in "rl"
        ]
        self._before: Array | None = None

    def add(self, pose: Pose) -> None:
        """Adds a pose, DT after the last one."""
        points = self._skeleton.joints(pose.root_position, pose.rotation)[self._points]
        thigh, shank, foot = np.diff(points, axis=1).swapaxes(0, 1)
        pitch = np.arctan2(-foot[:, 2], np.hypot(foot[:, 0], foot[:, 1]))
        before = points if self._before is None else self._before
        speed = np.linalg.norm(points[:, 3] - before[:, 3], axis=1) / (DT * self._skeleton.leg_length)
        self._before = points
        bends = [angle_between(a, b) for a, b in zip(thigh, shank, strict=True)]
        self.rows.append((np.array(bends), pitch, speed < SLOW))


class RobotLegs:
    """The same of a simulated robot, with the loads on its feet and the work of its ankles."""

    def __init__(self, model: mujoco.MjModel, feet: Sequence[Foot]) -> None:
        self._model, self._toes = model, [foot.axes[:, 0] for foot in feet]
        self._feet = [int(model.body(foot.body).id) for foot in feet]
        self.root = int(model.jnt_bodyid[0])
        self.weight = GRAVITY * float(model.body_subtreemass[self.root])
        self._knees = [knee_of(model, self.root, foot) for foot in self._feet]
        self._ankles = [np.flatnonzero(model.dof_bodyid == foot) for foot in self._feet]
        rest = mujoco.MjData(model)
        mujoco.mj_kinematics(model, rest)
        self.right_first = np.argsort([rest.xpos[foot, 1] for foot in self._feet])
        self._own = [np.array([foot in path_to(model, body) for body in range(model.nbody)]) for foot in self._feet]

    def __call__(self, data: mujoco.MjData) -> tuple[Array, Array, Array, Array]:
        """Bends and pitches, rad, loads in shares of the weight, and work in this tick, J; shape (2,) each."""
        model, force, loads = self._model, np.empty(6), np.zeros(2)
        for index in range(data.ncon):
            contact = data.contact[index]
            bodies = model.geom_bodyid[contact.geom]
            if 0 in bodies:
                mujoco.mj_contactForce(model, data, index, force)
                up = abs(float(force[:3] @ contact.frame.reshape(3, 3)[:, 2])) / self.weight
                loads += up * np.array([own[bodies.max()] for own in self._own])
        toes = [data.xmat[b].reshape(3, 3)[2] @ ahead for b, ahead in zip(self._feet, self._toes, strict=True)]
        work = [max(float(data.qfrc_actuator[dofs] @ data.qvel[dofs]), 0.0) * DT for dofs in self._ankles]
        bends = [self._bend(data, foot) for foot in range(2)]
        return np.array(bends), -np.arcsin(np.clip(toes, -1.0, 1.0)), loads, np.array(work)

    def _bend(self, data: mujoco.MjData, foot: int) -> float:
        knee = self._knees[foot]
        if knee is not None:
            return abs(float(data.qpos[self._model.jnt_qposadr[knee[0]]]) - knee[1])
        shank = int(self._model.body_parentid[self._feet[foot]])
        hip, middle, ankle = (data.xpos[b] for b in (int(self._model.body_parentid[shank]), shank, self._feet[foot]))
        return angle_between(middle - hip, ankle - middle)


def angle_between(a: Array, b: Array) -> float:
    """The angle of two vectors (3,), rad."""
    return float(np.arccos(np.clip(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)), -1.0, 1.0)))


def knee_of(model: mujoco.MjModel, root: int, foot: int) -> tuple[int, float] | None:
    """The hinge of a leg by which its length changes most, and its angle where it is longest; None for ball joints."""
    hinges, data = [*hinges_between(model, root, foot)], mujoco.MjData(model)
    found, most = None, 0.0
    for joint in hinges[1:-1]:
        low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.pi, np.pi)
        angles, lengths = np.linspace(low, high, 361), list[float]()
        for angle in angles:
            data.qpos[:] = model.qpos0
            data.qpos[model.jnt_qposadr[joint]] = angle
            mujoco.mj_kinematics(model, data)
            lengths.append(float(np.linalg.norm(data.xanchor[hinges[0]] - data.xanchor[hinges[-1]])))
        if np.ptp(lengths) > most:
            found, most = (int(joint), float(angles[int(np.argmax(lengths))])), float(np.ptp(lengths))
    return found


def walked(
    stage: PhysicsPlayback,
    feet: Sequence[Foot],
    course: Course,
    human: HumanLegs,
    keep: Callable[[Array], object] = lambda _: None,
) -> dict[str, Any]:
    """Walks a course until a fall, and measures; `keep` is called with each qpos (nq,)."""
    legs, rows, upright = RobotLegs(stage.model, feet), list[tuple[Array, Array, Array, Array]](), None
    high = 0.0
    for targets, root, heading in zip(course.targets, course.roots, course.headings, strict=True):
        stage.write(targets, placed_pose(root, float(heading)))
        trunk = stage.data.xmat[legs.root].reshape(3, 3)
        if upright is None:
            high, upright = float(stage.data.qpos[2]), trunk.T @ (0.0, 0.0, 1.0)
        if stage.data.qpos[2] < FELL_HEIGHT * high or trunk[2] @ upright < np.cos(FELL_TILT):
            break
        rows.append(legs(stage.data))
        keep(stage.data.qpos)
    asked, went = stage.travel or (0.0, 0.0)
    found = {"stood_s": len(rows) * DT, "asked_m": asked, "walked_m": went}
    lag = round(stage.behind_s / DT)
    first = round(BEGUN / DT)
    if len(rows) - lag - first < 1.0 / DT:
        return found
    bend, pitch, load, work = (np.array(column)[first + lag :, legs.right_first] for column in zip(*rows, strict=True))
    theirs = [np.array(column)[first : len(rows) - lag] for column in zip(*human.rows, strict=True)]
    step = legs.weight * float(stage.model.body(legs.root).pos[2])
    return found | beside(bend, pitch, load, work / step, *theirs)


def beside(
    bend: Array, pitch: Array, load: Array, work: Array, human: Array, foot: Array, stands: NDArray[np.bool_]
) -> dict[str, Any]:
    """Measures, in degrees, of T ticks of right and left legs, shape (T, 2) each.

    Of the robot: bends of the knees, rad, pitches, rad, loads and work of the ankles; of the human at the same times of
    the motion: bends, pitches and whether feet stand.
    """
    alone = (load > CARRIES) & (load[:, ::-1] < LOADED)
    theirs = stands & ~stands[:, ::-1]
    off = np.degrees(np.abs(bend - human)[alone & theirs])
    level = np.where(stands.any(axis=0), [np.median(foot[s, k]) if s.any() else 0.0 for k, s in enumerate(stands.T)], 0)
    before = round(LEAVING / DT)
    heels = [pitch[max(t - before, 0) : t + 1, k].max() for t, k in _leaves(load > LOADED)]
    human_heels = [foot[t, k] - level[k] for t, k in _leaves(stands)]
    return {
        "knee": _mean(np.degrees(bend[alone])),
        "human_knee": _mean(np.degrees(human[theirs])),
        "off": _mean(off),
        "off_p95": float(np.quantile(off, 0.95)) if len(off) else None,
        "heel": _mean(np.degrees(heels)),
        "human_heel": _mean(np.degrees(human_heels)),
        "push": 100.0 * float(work[load > LOADED].sum()) / max(len(heels), 1),
    }


def _leaves(down: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """The last ticks and the sides of feet that leave the floor for AWAY; a foot that lands may bounce."""
    away, ends = round(AWAY / DT), np.argwhere(down[:-1] & ~down[1:])
    return [(int(t), int(k)) for t, k in ends if not down[t + 1 : t + 1 + away, k].any()]


def _mean(values: Array) -> float | None:
    return float(np.mean(values)) if len(values) else None
