"""A robot with all joints at zero, its root turned: surface points and limbs of hinges."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from controller.motion.rotations import Array, multiply
from sim.models.kinematic_tree import below, hinges_at, path_to
from sim.models.limb_geometry import farthest
from sim.models.surface import Surface

STANDS = 0.12  # largest height of a standing limb's end, in heights of the robot
PARALLEL = 0.5  # least cosine between mirrored twins' axes
ROLLS, ROUND = 0.2, 0.15  # largest height and unevenness of a wheel, in its radius


@dataclass(frozen=True)
class RobotLimb:
    """A chain of hinges on one side, and its end point."""

    joints: list[int]
    tip: Array


class StandingBody:
    """A robot whose joints are all at zero.

    Attributes:
        data: its state.
        root: its root body.
        surface, points, heights: its skin, with positions (P, 3), m, and lowest heights (P,), m.
        floor, tall: the lowest height, and the robot's height, m.
        ends: the bodies with hinges above no other such body.
    """

    def __init__(self, model: mujoco.MjModel, turn: Array) -> None:
        """Turns the root by a quaternion (4,) from how the file has it."""
        self.model = model
        self.data = mujoco.MjData(model)
        self.data.qpos[3:7] = multiply(turn, model.qpos0[3:7])
        mujoco.mj_kinematics(model, self.data)
        self.root = int(model.jnt_bodyid[0])
        self.surface = Surface.of(model)
        self.points = self.surface.positions(self.data)
        self.heights = self.points[:, 2] - self.surface.radius
        self.floor = float(self.heights.min())
        self.tall = float(np.ptp(self.points[:, 2]))
        self.movers = [b for b in range(1, model.nbody) if hinges_at(model, b)]
        above = {b for mover in self.movers for b in path_to(model, mover)[:-1]}
        self.ends = [b for b in self.movers if b not in above]

    def is_wheel(self, body: int) -> bool:
        """Whether a body is round about a level axis without limits, and touches the floor."""
        (*_, joint) = hinges_at(self.model, body)
        axis = self.data.xaxis[joint]
        mine = np.isin(self.surface.body, self.fixed_to(body))
        if self.model.jnt_limited[joint] or abs(axis[2]) > PARALLEL or not mine.any():
            return False
        away = self.points[mine] - self.data.xanchor[joint]
        ahead = np.cross(axis, [0.0, 0.0, 1.0])
        ahead /= np.linalg.norm(ahead)
        radius = self.surface.radius[mine]
        ways = ahead, -ahead, np.cross(ahead, axis), -np.cross(ahead, axis)
        reaches = [float((away @ way + radius).max()) for way in ways]
        least, most = min(reaches), max(reaches)
        return least > (1.0 - ROUND) * most and self.lowest(body) < self.floor + ROLLS * most

    def limb(self, end: int, above: int) -> RobotLimb:
        """The joints from a body to an end, without fingers that fork off a hand."""
        path = path_to(self.model, end)
        path = path[path.index(above) + 1 :]
        joints: list[int] = []
        for body in path:
            joints += hinges_at(self.model, body)
            forks = sum(self._moves(child) for child in np.flatnonzero(self.model.body_parentid == body).tolist())
            if forks > 1 and len(joints) > 2 and self.lowest(end) > self.floor + STANDS * self.tall:
                return RobotLimb(joints, self.tip(body))
        return RobotLimb(joints, self.tip(path[-1]))

    def _moves(self, body: int) -> bool:
        return any(mover in below(self.model, body) for mover in self.movers)

    def tip(self, end: int) -> Array:
        """The surface point of a body, and of bodies fixed to it, farthest from its joint."""
        mine = self.points[np.isin(self.surface.body, self.fixed_to(end))]
        start = self.data.xanchor[hinges_at(self.model, end)[0]] if hinges_at(self.model, end) else self.data.xpos[end]
        return farthest(list(mine), start) if len(mine) else self.data.xpos[end].copy()

    def sole(self, end: int) -> Array:
        """The middle of the lowest points of a limb's end."""
        mine = np.isin(self.surface.body, below(self.model, end))
        if not mine.any():
            return self.data.xpos[end].copy()
        low = self.heights[mine] < self.heights[mine].min() + 0.02 * self.tall
        return self.points[mine][low].mean(axis=0)

    def lowest(self, end: int) -> float:
        """Height of the lowest point of a limb's end, m."""
        mine = np.isin(self.surface.body, below(self.model, end))
        return float(self.heights[mine].min()) if mine.any() else float(self.data.xpos[end, 2])

    def size(self, body: int) -> float:
        """The diagonal of the box around a body and what is fixed to it, m."""
        mine = np.isin(self.surface.body, self.fixed_to(body))
        if not mine.any():
            return 0.0
        points, radius = self.points[mine], self.surface.radius[mine, None]
        return float(np.linalg.norm((points + radius).max(axis=0) - (points - radius).min(axis=0)))

    def fixed_to(self, body: int) -> list[int]:
        """A body and what moves with it."""
        return [b for b in below(self.model, body) if self.model.body_weldid[b] == self.model.body_weldid[body]]

    def length(self, limb: RobotLimb) -> float:
        """Length of a limb from joint to joint and to its end, m."""
        points = np.vstack([self.data.xanchor[limb.joints], limb.tip])
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())

    def common(self, a: int, b: int) -> int:
        """The body at which the ways to two bodies part."""
        return [x for x, y in zip(path_to(self.model, a), path_to(self.model, b), strict=False) if x == y][-1]

    def branch(self, end: int, above: int) -> int:
        """The child of a body on the way to an end; 0 if the end does not hang from it."""
        path = path_to(self.model, end)
        return path[path.index(above) + 1] if above in path[:-1] else 0

    def name(self, body: int) -> str:
        """Its name in the file."""
        return str(self.model.body(int(body)).name)
