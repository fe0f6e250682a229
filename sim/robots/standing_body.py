"""A robot with all joints at zero, its root turned: surface points, limbs of hinges, and their division.

A knee (elbow) is the first hinge that lies across its limb, parallel to its mirrored twin, with much of the limb on
both sides. Hinges along the limb (yaw of a thigh, roll of a forearm) belong to the segment that they turn. The next
hinge across the limb is the ankle (wrist); toes and fingers are ignored.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from controller.motion.rotations import Array, multiply
from sim.models.kinematic_tree import below, hinges_at, path_to
from sim.models.limb_geometry import ACROSS, end_hinge, farthest, folds, sine, start_of
from sim.models.surface import Surface

STANDS = 0.12  # largest height of a standing limb's end, in heights of the robot
PARALLEL = 0.5  # least cosine between mirrored twins' axes
ROLLS, ROUND = 0.2, 0.15  # largest height and unevenness of a wheel, in its radius
LEG = ("thigh", "shank", "foot")
ARM = ("upper_arm", "forearm", "hand")

BEND_SHARE = 0.6  # share of the best hinge's shorter side from which the first hinge is the knee
# Largest distance of further joints ahead of the ankle, in shanks, and from the wrist, in forearms.
TOES_SHARE, FINGERS_SHARE = 0.15, 0.3


@dataclass(frozen=True)
class RobotLimb:
    """A chain of hinges on one side, and its end point."""

    joints: list[int]
    tip: Array


class StandingBody:
    """A robot whose joints are all at zero."""

    def __init__(self, model: mujoco.MjModel, turn: Array) -> None:
        """Turns the root by a quaternion (4,) from how the file has it."""
        self.model = model
        self.data = mujoco.MjData(model)
        self.data.qpos[3:7] = multiply(turn, model.qpos0[3:7])
        mujoco.mj_kinematics(model, self.data)
        self.root = int(model.jnt_bodyid[0])
        self.surface = Surface.of(model)
        self.points = self.surface.positions(self.data)  # shape (P, 3), m
        self.heights = self.points[:, 2] - self.surface.radius  # the lowest of each point's ball, shape (P,), m
        self.floor = float(self.heights.min())
        self.tall = float(np.ptp(self.points[:, 2]))  # m
        self.movers = [b for b in range(1, model.nbody) if hinges_at(model, b)]
        above = {b for mover in self.movers for b in path_to(model, mover)[:-1]}
        self.ends = [b for b in self.movers if b not in above]  # bodies with hinges above no other such body

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
            children = [below(self.model, child) for child in np.flatnonzero(self.model.body_parentid == body).tolist()]
            forks = sum(not {*self.movers}.isdisjoint(child) for child in children)
            if forks > 1 and len(joints) > 2 and self.lowest(end) > self.floor + STANDS * self.tall:
                return RobotLimb(joints, self.tip(body))
        return RobotLimb(joints, self.tip(path[-1]))

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

    def limb_bodies(
        self, names: tuple[str, str, str], limbs: dict[str, RobotLimb], ahead: Array, bends: Collection[str]
    ) -> dict[str, str]:
        """Part, such as "l_shank", to the name of its body, for three parts of each limb, or two without an end hinge.

        `names` is LEG or ARM, `limbs` "l" and "r" to limbs that can bend, `ahead` (3,) the robot's heading, and `bends`
        the names of hinges that are knees or elbows.
        """
        parts, data, moved = {}, self.data, self.model.jnt_bodyid
        for side, limb in limbs.items():
            bend = next((k for k, joint in enumerate(limb.joints) if self.model.joint(joint).name in bends), 0)
            bend = bend or self.possible_bends(limb, limbs.get("l" if side == "r" else "r", limb))[0]
            knee = limb.joints[bend]
            upper = next((one for one in reversed(limb.joints[:bend]) if moved[one] != moved[knee]), limb.joints[0])
            found = [upper, knee]
            end = self.end_joint(limb, bend)
            if end is not None:
                at = data.xanchor[end]
                span = float(np.linalg.norm(at - data.xanchor[knee]))
                for joint in limb.joints[limb.joints.index(end) + 1 :]:
                    way = data.xanchor[joint] - at
                    if way @ ahead < TOES_SHARE * span if names is LEG else np.linalg.norm(way) < FINGERS_SHARE * span:
                        end = joint
                found.append(end)
            parts |= {f"{side}_{name}": self.name(moved[joint]) for name, joint in zip(names, found, strict=False)}
        return parts

    def possible_bends(self, limb: RobotLimb, twin: RobotLimb) -> list[int]:
        """The indices of a limb's joints that may be its knee (elbow), from the trunk on: much of it on both sides.

        The first is taken to be it. A limb without a twin is its own.
        """
        at = [self.data.xanchor[j] for j in limb.joints]
        between = at[0] - self.data.xanchor[twin.joints[0]]
        mirror = between / max(float(np.linalg.norm(between)), 1e-9)
        score: dict[int, float] = {}
        for k in range(1, len(at)):
            if self.model.jnt_bodyid[limb.joints[k]] == self.model.jnt_bodyid[limb.joints[0]]:
                continue  # it would leave no body for the upper segment
            up = start_of(self.data, limb.joints[:k], at[k]) - at[k]
            down = farthest([*at[k + 1 :], limb.tip], at[k]) - at[k]
            axis = self.data.xaxis[limb.joints[k]]
            share = min(float(np.linalg.norm(up)), float(np.linalg.norm(down)))
            across = min(sine(axis, up), sine(axis, down)) >= ACROSS
            other = self.data.xaxis[twin.joints[k]] if len(twin.joints) == len(limb.joints) else axis
            other = other - 2.0 * (other @ mirror) * mirror
            # Other hinges are knees only if there is no better one.
            score[k] = share * (1.0 if across and abs(axis @ other) >= PARALLEL else 0.1)
        most = max(score.values())
        return [k for k, value in score.items() if value >= BEND_SHARE * most]

    def rival_bends(self, limbs: dict[str, RobotLimb]) -> list[tuple[str, ...]]:
        """Other hinges that may be the knees (elbows) of a limb and its twin, right and left, by name."""
        sides = [side for side in "rl" if side in limbs]
        pairs = zip([limbs[side] for side in sides], [limbs[side] for side in reversed(sides)], strict=True)
        possible = [self.possible_bends(*pair) for pair in pairs]
        joints, moved = [limbs[side].joints for side in sides], self.model.jnt_bodyid
        return [
            tuple(self.model.joint(mine[k]).name for mine in joints)
            for k in possible[0][1:]
            if all(k in other for other in possible) and moved[joints[0][k]] != moved[joints[0][possible[0][0]]]
        ]

    def end_joint(self, limb: RobotLimb, knee: int) -> int | None:
        """The first joint of the ankle (wrist), for the index of the knee; None without one."""
        at = self.data.xanchor[limb.joints[knee]]
        upper = float(np.linalg.norm(start_of(self.data, limb.joints[:knee], at) - at))
        return end_hinge(self.data, limb.joints[knee + 1 :], at, upper)

    def front_direction(self, limb: RobotLimb, knee: int) -> Array:
        """The front of a leg without an ankle, shape (3,), m: away from the fold of its knee."""
        joint = limb.joints[knee]
        axis, at = self.data.xaxis[joint], self.data.xanchor[joint]
        up, down = at - start_of(self.data, limb.joints[:knee], at), limb.tip - at
        return -folds(self.model, joint, axis, up, down) * np.cross(axis, down)


def can_bend(model: mujoco.MjModel, joints: Sequence[int]) -> bool:
    """Whether hinges move at least two bodies."""
    return len({int(model.jnt_bodyid[joint]) for joint in joints}) > 1
