"""Balance: a motion on the spot, with both feet in place and the centre of mass above them.

The posture is that of `WholeBody`, with this goal of the centre of mass:

    c = middle of the support - K (xi - xi planned),      xi = com + velocity / omega,      omega^2 = g / height

xi is the capture point (Pratt et al. 2006) of the simulated robot. By the ankle strategy ankles push the centre of mass
back. Near the border of the support ankles are at their limit, and the hips bend towards xi (the hip strategy).
"""

import mujoco
import numpy as np

from controller.motion.rotations import Array, about, conjugate, from_matrix, multiply, rotate, yaw
from motiondeck_base.errors import MotiondeckError
from sim.models.gravity import GRAVITY
from sim.models.kinematic_tree import posed
from sim.physics.physics_model import feet_of
from sim.physics.walking.steps import azimuth, rotated
from sim.physics.walking.whole_body import WholeBody
from sim.robots.robot import Robot

HEIGHT = 2.0  # weight of the root's height, 1/m
# The ankle strategy's gain, and its largest shift of the goal, as a share of the support.
ANKLE_GAIN, ANKLE_REACH = 1.0, 0.8
# The hip strategy: rad for each metre (of a leg one metre long) nearer to the border than HIP_FROM of the support.
HIP_GAIN, HIP_FROM, HIP_MOST = 4.0, 0.5, 0.6
# Least distance of the feet sideways and largest one ahead, in heights of the root; largest turn from the heading, rad.
STANCE_WIDTH, STANCE_LENGTH, STANCE_TURN = 0.30, 0.25, 0.6
SMOOTHING = 0.03  # time constant of the capture point, s: a landing heel shakes the velocity
LOST = 0.5  # error of the capture point from which a fall is certain, in heights of the centre of mass


class Balance:
    """Adjusts the played motion so that a free robot stays on its feet; MotiondeckError if it does not have two."""

    falling: bool = False  # whether the error of the capture point is beyond LOST

    def __init__(self, robot: Robot, model: mujoco.MjModel, dt: float) -> None:
        """Args: the robot; its model with a free root on a solid floor; the tick, s."""
        self._robot, self._model, self._dt, self._feet = robot, model, dt, feet_of(robot)
        if len(self._feet) != 2:
            count = len(self._feet)
            raise MotiondeckError(f"robot '{robot.name}' has {count} feet; only one that stands on two can balance")
        self._body = WholeBody(robot, model, self._feet, dt, HEIGHT)
        self._plan, self._bodies = self._body.plan, self._body.bodies

    def start(self, data: mujoco.MjData) -> None:
        """Plants the feet below their present places, and puts the robot into a balanced stance there."""
        model, plan = self._model, self._plan
        self._heading: float | None = None
        plan.qpos[:] = data.qpos
        mujoco.mj_kinematics(model, plan)
        self._plant()
        corners = self._corners(plan, planted=True)
        self._middle = np.mean([corners[:4].mean(axis=0), corners[4:].mean(axis=0)], axis=0)
        self._support = convex_hull(corners)
        self._half = margin(self._support, self._middle)
        self._smooth = np.zeros(2)
        self._body.settle(data.qpos.copy(), self._place, self._flat, self._middle)
        data.qpos[:] = plan.qpos
        self._lift = float(plan.qpos[2])
        self._first_height: float | None = None

    def adjust(self, data: mujoco.MjData, goal: Array, heading: float) -> None:
        """Replaces a goal (nq,) by a balanced one, for the robot's state and the heading of the played motion, rad."""
        if self._heading is None:
            self._heading, self._first_height = heading, float(goal[2])
        wanted = goal.copy()
        assert self._first_height is not None
        wanted[2] = self._lift + goal[2] - self._first_height
        off = self._off(data)
        self.falling = float(np.hypot(*off)) > LOST * GRAVITY / self._omega**2
        wanted[3:7] = multiply(self._hips(off), multiply(yaw(self._heading - heading), goal[3:7]))
        ankles = -ANKLE_GAIN * off
        ankles *= min(1.0, ANKLE_REACH * self._half / max(float(np.hypot(*ankles)), 1e-9))
        self._body.step(wanted, self._place, self._flat, self._middle + ankles)
        goal[:] = self._plan.qpos

    def _plant(self) -> None:
        """Chooses the places of the feet: on the floor below, in a stance that can balance."""
        plan, rest = self._plan, posed(self._model, self._robot.rest_qpos)
        turned = multiply(plan.qpos[3:7], conjugate(self._model.qpos0[3:7]))
        facing = azimuth(rotate(turned, np.array([1.0, 0.0, 0.0])))
        ahead = np.array([np.cos(facing), np.sin(facing)])
        left = np.array([-ahead[1], ahead[0]])
        at, turn = [], []
        for foot, body in zip(self._feet, self._bodies, strict=True):
            axes = plan.xmat[body].reshape(3, 3)
            at.append((plan.xpos[body] + axes @ foot.sole)[:2])
            own = azimuth(axes @ foot.axes[:, 0]) - facing
            turn.append(facing + np.clip(np.arctan2(np.sin(own), np.cos(own)), -STANCE_TURN, STANCE_TURN))
        middle, apart = 0.5 * (at[0] + at[1]), 0.5 * (at[0] - at[1])
        height = float(plan.qpos[2])
        side = 1.0 if rest.xpos[self._bodies[0], 1] > rest.xpos[self._bodies[1], 1] else -1.0
        wide = side * max(side * float(apart @ left), 0.5 * STANCE_WIDTH * height)
        long = float(np.clip(apart @ ahead, -0.5 * STANCE_LENGTH * height, 0.5 * STANCE_LENGTH * height))
        apart = long * ahead + wide * left
        self._place = [np.array([*(middle + apart), 0.0]), np.array([*(middle - apart), 0.0])]
        self._flat = [multiply(yaw(to), from_matrix(foot.axes.T)) for to, foot in zip(turn, self._feet, strict=True)]

    def _off(self, data: mujoco.MjData) -> Array:
        """How far the capture point is from the planned centre, seen from the feet, shape (2,), m."""
        mujoco.mj_subtreeVel(self._model, data)
        root = int(self._model.jnt_bodyid[0])
        com, velocity = data.subtree_com[root], data.subtree_linvel[root]
        here = self._corners(data)
        middle = 0.5 * (here[:4].mean(axis=0) + here[4:].mean(axis=0))
        self._omega = np.sqrt(GRAVITY / max(float(com[2]), 0.05))
        off = com[:2] + velocity[:2] / self._omega - middle
        # Feet slip a little with every blow, and the robot may have turned by now.
        (x, y), (u, v) = here[4:].mean(axis=0) - here[:4].mean(axis=0), self._place[1][:2] - self._place[0][:2]
        turn = np.arctan2(x * v - y * u, x * u + y * v)
        self._smooth += (1.0 - np.exp(-self._dt / SMOOTHING)) * (rotated(off, turn) - self._smooth)
        return self._smooth

    def _hips(self, off: Array) -> Array:
        """The turn of the root by the hip strategy, a quaternion."""
        far, leg = float(np.hypot(*off)), GRAVITY / self._omega**2
        angle = min(HIP_GAIN * max(far - HIP_FROM * self._half, 0.0) / leg, HIP_MOST)
        if angle == 0.0:
            return np.array([1.0, 0.0, 0.0, 0.0])
        return about(np.array([-off[1], off[0], 0.0]) / far, angle)

    def _corners(self, data: mujoco.MjData, planted: bool = False) -> Array:
        """The corners of both soles on the floor, shape (8, 2), m."""
        found = []
        for k, (foot, body) in enumerate(zip(self._feet, self._bodies, strict=True)):
            if planted:
                matrix = np.empty(9)
                mujoco.mju_quat2Mat(matrix, self._flat[k])
                found.append(self._place[k] + (foot.corners - foot.sole) @ matrix.reshape(3, 3).T)
            else:
                found.append(data.xpos[body] + foot.corners @ data.xmat[body].reshape(3, 3).T)
        return np.concatenate(found)[:, :2]


def convex_hull(points: Array) -> Array:
    """The corners (K, 2) of the convex hull of points (N, 2), anticlockwise; fewer than three if they lie on a line."""
    ordered = sorted(map(tuple, np.asarray(points, dtype=np.float64).tolist()))

    def chain(way: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
        kept: list[tuple[float, ...]] = []
        for point in way:
            while len(kept) > 1 and _turn(kept[-2], kept[-1], point) <= 0.0:
                kept.pop()
            kept.append(point)
        return kept[:-1]

    corners = chain(ordered) + chain(ordered[::-1])
    return np.array(corners or ordered[:1], dtype=np.float64).reshape(-1, 2)


def margin(polygon: Array, point: Array) -> float:
    """How far inside a convex polygon (K, 2), anticlockwise, a point (2,) lies, m; outside it is minus the distance."""
    if len(polygon) == 0:
        return -np.inf
    edge = np.roll(polygon, -1, axis=0) - polygon
    length = np.maximum(np.hypot(edge[:, 0], edge[:, 1]), 1e-12)
    away = point - polygon
    if len(polygon) > 2:
        inside = (edge[:, 0] * away[:, 1] - edge[:, 1] * away[:, 0]) / length
        if inside.min() >= 0.0:
            return float(inside.min())
    share = np.clip((away * edge).sum(axis=1) / length**2, 0.0, 1.0)
    nearest = away - share[:, None] * edge
    return -float(np.hypot(nearest[:, 0], nearest[:, 1]).min())


def _turn(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
