"""Whole body: joint positions with feet and centre of mass at their goals and all else as played; knees; widest stance.

Each tick makes one damped least-squares step on a separate state, from the last solution:

    min over dv of   |W_f (J_f dv - e_f)|^2 + |W_c (J_c dv - e_c)|^2 + |W_q (dv - e_q)|^2

where e_f is the distance of the soles from their places, e_c that of the centre of mass from its goal, and e_q that of
root and joints from the played motion: the legs give way, the rest of the body keeps playing. Long steps of flat feet
pull the root down. Where it would rise faster than it may, or a knee would become straight, the step is solved again
with that as a constraint.
"""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array, conjugate, cross, multiply, rotate, to_rotation_vector
from sim.models.feet import Foot
from sim.models.kinematic_tree import hinges_between, path_to, posed
from sim.models.limb_geometry import bent_by, centre_of, end_hinge
from sim.robots.robot import Robot

# Weights of one metre or one radian off.
FOOT, CENTRE, LEAN, LEG, REST = 100.0, 60.0, 3.0, 0.3, 3.0
STARTING_STEPS = 60
HELD = 1e4  # weight of constraints
# A leg with fewer hinges cannot put a foot anywhere at any angle: an ankle without roll leaves it at this weight.
LEG_HINGES, ROLL = 6, 1.0
# Least bend of a knee, rad, and least share of a leg on either side of it. For a place out of reach a straight leg asks
# for large turns of its knee, to and fro, and pulls the root down.
BENT, SHARE = 0.15, 0.25
# A landing foot is flat if it is turned by less than this, rad, and in place within this many heights of the root.
FLAT, THERE = 0.05, 0.01
# The centre of mass as a foot lands, as a share of the way to that foot; bisections of the widest stance.
SHIFTED, HALVINGS = 0.35, 6
UP = np.array([0.0, 0.0, 1.0])


def knee_of(model: mujoco.MjModel, body: int) -> tuple[int, float] | None:
    """The hinge that shortens the leg of a foot most, and its angle in the straight leg, rad; None without a knee."""
    data = posed(model)
    hinges = hinges_between(model, int(model.jnt_bodyid[0]), body)
    found, most, leg = None, 0.0, 0.0
    for k in range(1, len(hinges)):
        joint, at, axis = hinges[k], data.xanchor[hinges[k]], data.xaxis[hinges[k]]
        up = centre_of(data, hinges[:k], at) - at
        ankle = end_hinge(data, hinges[k + 1 :], at, float(np.linalg.norm(up)))
        if ankle is None:
            continue
        down = data.xanchor[ankle] - at
        leg = max(leg, float(np.linalg.norm(up - down)))
        least = min(float(np.linalg.norm(way - (way @ axis) * axis)) for way in (up, down))
        if least > most:
            straight = float(model.qpos0[model.jnt_qposadr[joint]]) - bent_by(axis, -up, down)
            found, most = (joint, straight), least
    return found if most > SHARE * leg else None


def bent_knees(model: mujoco.MjModel, bodies: Sequence[int]) -> tuple[NDArray[np.int64], Array, Array]:
    """The knees above feet, K joints of the model, and the bounds that keep them bent, rad, shape (K,) each."""
    found = [knee for knee in (knee_of(model, body) for body in bodies) if knee is not None]
    joints = np.array([joint for joint, _ in found], dtype=np.int64)
    straight = np.array([angle for _, angle in found])
    limited = model.jnt_limited[joints].astype(bool)[:, None]
    lower, upper = np.where(limited, model.jnt_range[joints], (-np.pi, np.pi)).T
    folds = upper - straight > straight - lower
    bent = np.clip(np.where(folds, straight + BENT, straight - BENT), lower, upper)
    return joints, np.where(folds, bent, lower), np.where(folds, upper, bent)


class WholeBody:
    """Solves for the posture of a robot on two feet."""

    def __init__(
        self, robot: Robot, model: mujoco.MjModel, feet: Sequence[Foot], dt: float, height_weight: float
    ) -> None:
        """Args: the robot; its model with a free root; two feet; the tick, s; the weight of the root's height, 1/m."""
        self._robot, self._model = robot, model
        self.plan = mujoco.MjData(model)  # MuJoCo's state of the last solution
        self.bodies = [int(model.body(foot.body).id) for foot in feet]  # of the feet
        self._soles, self._axes = [foot.sole for foot in feet], [foot.axes for foot in feet]
        hinges = [int(model.body_dofnum[path_to(model, body)[1:]].sum()) for body in self.bodies]
        self._cannot_roll = [k for k, count in enumerate(hinges) if count < LEG_HINGES]
        legs = [part for body in self.bodies for part in path_to(model, body)[1:]]
        self.legs = np.isin(model.dof_bodyid, legs)  # which degrees of freedom belong to legs, shape (nv,)
        self._weight = np.where(self.legs, LEG, REST)  # cost of not going as it is played
        self._weight[:6] = 0.0, 0.0, height_weight, LEAN, LEAN, LEAN
        self._most = np.full(model.nv, np.inf)  # in a tick
        self._most[robot.layout.dof] = robot.limits.velocity * dt
        knees, *self._ends = bent_knees(model, self.bodies)
        self._knees = model.jnt_dofadr[knees], model.jnt_qposadr[knees]
        self._error = np.empty(model.nv)
        # Of the last step: soles and their turns, then the centre of mass, shape (15, nv).
        self.jacobian = np.empty((15, model.nv))

    def settle(self, goal: Array, places: Sequence[Array], turns: Sequence[Array], centre: Array) -> None:
        """Iterates `step` to convergence, without limits of speed."""
        for _ in range(STARTING_STEPS):
            self.step(goal, places, turns, centre, pace=np.inf)
        mujoco.mj_kinematics(self._model, self.plan)

    def step(
        self,
        goal: Array,
        places: Sequence[Array],
        turns: Sequence[Array],
        centre: Array,
        rise: float = np.inf,
        pace: float = 1.0,
    ) -> None:
        """One step from the last solution towards the played posture (nq,).

        The goals of the soles are their middles (3,), m, and quaternions of the feet's bodies; that of the centre of
        mass is (2,), m. `rise` is the root's largest rise, and its largest drop to keep knees bent, m; `pace` is the
        largest step of the joints, in ticks of their speed.
        """
        model, plan = self._model, self.plan
        mujoco.mj_kinematics(model, plan)
        mujoco.mj_comPos(model, plan)
        root = int(model.jnt_bodyid[0])
        jacobian, off = self.jacobian[:14], np.empty(14)
        weight, tasks = np.empty(14), jacobian
        for k, body in enumerate(self.bodies):
            rows = slice(6 * k, 6 * k + 3), slice(6 * k + 3, 6 * k + 6)
            sole = self.sole(plan, k)
            mujoco.mj_jac(model, plan, jacobian[rows[0]], jacobian[rows[1]], sole, body)
            off[rows[0]] = places[k] - sole
            off[rows[1]] = to_rotation_vector(multiply(turns[k], conjugate(plan.xquat[body])))
            weight[rows[0]], weight[rows[1]] = FOOT, 0.3 * FOOT
        mujoco.mj_jacSubtreeCom(model, plan, self.jacobian[12:], root)
        off[12:] = centre - plan.subtree_com[root, :2]
        weight[12:] = CENTRE
        if self._cannot_roll:
            tasks = jacobian.copy()
            for k in self._cannot_roll:
                # Seen from the sole, so that its roll can be left to the leg.
                axes, turn = plan.xmat[self.bodies[k]].reshape(3, 3) @ self._axes[k], slice(6 * k + 3, 6 * k + 6)
                tasks[turn], off[turn] = axes.T @ jacobian[turn], axes.T @ off[turn]
                weight[6 * k + 3] = ROLL
        mujoco.mj_differentiatePos(model, self._error, 1.0, plan.qpos, goal)
        square = np.square(self._weight)
        weighted = tasks * np.square(weight)[:, None]
        matrix = tasks.T @ weighted
        matrix[np.diag_indices_from(matrix)] += square + 1e-6
        wanted = square * self._error + weighted.T @ off
        step = _solve(matrix, wanted, [], [])
        if step[2] > rise:
            step = _solve(matrix, wanted, [2], [rise])
        step = self._bent(matrix, wanted, step, rise)
        most = self._most * pace
        mujoco.mj_integratePos(model, plan.qpos, np.clip(step, -most, most), 1.0)
        layout, limits = self._robot.layout, self._robot.limits
        at = layout.hinge_qpos
        plan.qpos[at] = np.clip(plan.qpos[at], limits.lower[layout.hinge], limits.upper[layout.hinge])

    def sole(self, data: mujoco.MjData, foot: int) -> Array:
        """The middle of the sole of a foot in a state, shape (3,), m."""
        body = self.bodies[foot]
        return data.xpos[body] + data.xmat[body].reshape(3, 3) @ self._soles[foot]

    def pushed(self, foot: int, force: Array, arm: Array) -> Array:
        """The joint torques (nv,), N m, of a force (3,), N, on a sole, `arm` (3,), m, from its middle."""
        rows = self.jacobian[6 * foot : 6 * foot + 6]
        return rows[:3].T @ force + rows[3:].T @ cross(arm, force)

    def _bent(self, matrix: Array, wanted: Array, step: Array, rise: float) -> Array:
        """The step (nv,) with knees that stay bent, and a root that sinks for that no faster than it may rise."""
        dofs, at = self._knees
        ends = np.clip(step[dofs], *(end - self.plan.qpos[at] for end in self._ends))
        beyond = ends != step[dofs]
        if not beyond.any():
            return step
        held, to = dofs[beyond].tolist(), ends[beyond].tolist()
        bent = _solve(matrix, wanted, held, to)
        high = min(max(float(bent[2]), -rise), rise)
        return bent if bent[2] == high else _solve(matrix, wanted, [2, *held], [high, *to])


def _solve(matrix: Array, wanted: Array, given: Sequence[int], to: Sequence[float]) -> Array:
    """The least-squares step (nv,) in which some degrees of freedom go as far as is given."""
    matrix, wanted = matrix.copy(), wanted.copy()
    matrix[given, given] += HELD**2
    wanted[given] += HELD**2 * np.asarray(to)
    return np.linalg.solve(matrix, wanted).astype(np.float64, copy=False)


def widest_stance(
    body: WholeBody, goal: Array, flat: Sequence[Array], sides: Array, least: float, most: float
) -> float:
    """The widest stance, m, into which either foot lands flat: one that lands on its inner edge tips the robot over.

    For the standing posture, facing x, (nq,), the rotations of the feet's bodies with flat soles that point to x, their
    sides, 1 for left, (2,), and bounds of the answer, m; the last solution of `body` is lost.
    """

    def lands_flat(foot: int, apart: float) -> bool:
        places = [np.array([goal[0], goal[1] + 0.5 * side * apart, 0.0]) for side in sides]
        stands = places[1 - foot]
        body.plan.qpos[:] = goal
        body.settle(goal, places, flat, (stands + SHIFTED * (places[foot] - stands))[:2])
        turned = multiply(body.plan.xquat[body.bodies[foot]], conjugate(flat[foot]))
        off_level = float(np.arccos(min(rotate(turned, UP)[2], 1.0)))
        off_place = float(np.linalg.norm(body.sole(body.plan, foot) - places[foot]))
        return off_level < FLAT and off_place < THERE * goal[2]

    if all(lands_flat(foot, most) for foot in range(2)):
        return most
    for _ in range(HALVINGS):
        middle = 0.5 * (least + most)
        flat_there = all(lands_flat(foot, middle) for foot in range(2))
        least, most = (middle, most) if flat_there else (least, middle)
    return least
