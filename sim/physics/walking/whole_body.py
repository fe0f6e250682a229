"""Whole body: joint positions with both feet and the centre of mass where they are wanted, the rest as it is played.

Each tick makes one damped least-squares step on a robot of its own, from where the last one left it:

    min over dv of   |W_f (J_f dv - e_f)|^2 + |W_c (J_c dv - e_c)|^2 + |W_q (dv - e_q)|^2

where e_f is the distance of the soles from their places, e_c that of the centre of mass from its goal, and e_q that of
root and joints from the played motion: the legs give way, the rest of the body keeps playing. Long steps of flat feet
pull the root down. Where it would rise faster than it may, or a knee would become straight (`knees`), the step is
solved again with that given.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from controller.motion.rotations import Array, conjugate, cross, multiply, to_rotation_vector
from sim.models.feet import Foot
from sim.models.kinematic_tree import path_to
from sim.physics.walking.knees import bent_knees
from sim.robots.robot import Robot

# Weights of one metre or one radian off.
FOOT, CENTRE, LEAN, LEG, REST = 100.0, 60.0, 3.0, 0.3, 3.0
STARTING_STEPS = 60
# Weight of what is given.
HELD = 1e4
# A leg with fewer hinges cannot put a foot anywhere at any angle: an ankle without roll leaves it at this weight.
LEG_HINGES, ROLL = 6, 1.0


class WholeBody:
    """Solves for the posture of a robot on two feet.

    Attributes:
        plan: MuJoCo's state of the last solution.
        bodies: of the feet.
        legs: which degrees of freedom belong to legs, shape (nv,).
        jacobian: of the last step: soles and their turns, then the centre of mass, shape (15, nv).
    """

    def __init__(
        self, robot: Robot, model: mujoco.MjModel, feet: Sequence[Foot], dt: float, height_weight: float
    ) -> None:
        """Takes a robot with two feet.

        Args:
            robot: which.
            model: the robot with a free root.
            feet: of it.
            dt: between two solutions, s.
            height_weight: what it costs that the root is a metre higher or lower than it is played.
        """
        self._robot, self._model = robot, model
        self.plan = mujoco.MjData(model)
        self.bodies = [int(model.body(foot.body).id) for foot in feet]
        self._soles, self._axes = [foot.sole for foot in feet], [foot.axes for foot in feet]
        hinges = [int(model.body_dofnum[path_to(model, body)[1:]].sum()) for body in self.bodies]
        self._cannot_roll = [k for k, count in enumerate(hinges) if count < LEG_HINGES]
        self._weight = self._weights(height_weight)
        self.legs = self._weight == LEG
        self._most = self._fastest() * dt
        knees, *self._ends = bent_knees(model, self.bodies)
        self._knees = model.jnt_dofadr[knees], model.jnt_qposadr[knees]
        self._error = np.empty(model.nv)
        self.jacobian = np.empty((15, model.nv))

    def settle(self, goal: Array, places: Sequence[Array], turns: Sequence[Array], centre: Array) -> None:
        """Solves it to the end, however far joints have to go; as `step`."""
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
        """Goes one step from the last solution.

        Args:
            goal: the played posture, shape (nq,).
            places: where the middles of the soles are to be, two of shape (3,), m.
            turns: the rotations of the feet's bodies, two quaternions.
            centre: where the centre of mass is to be, shape (2,), m.
            rise: how far the root may go up in this step, and down to keep knees bent, m.
            pace: how many ticks the step may take up of the joints' speed.
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
        self._within_limits()

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

    def _within_limits(self) -> None:
        layout, limits, qpos = self._robot.layout, self._robot.limits, self.plan.qpos
        if len(layout.hinge):
            at = layout.hinge_qpos
            qpos[at] = np.clip(qpos[at], limits.lower[layout.hinge], limits.upper[layout.hinge])

    def _weights(self, height: float) -> Array:
        """What it costs each degree of freedom not to go as it is played, shape (nv,)."""
        model = self._model
        weight = np.full(model.nv, REST)
        weight[:6] = (0.0, 0.0, height, LEAN, LEAN, LEAN)
        for body in self.bodies:
            while model.body_parentid[body] != 0:
                first, count = model.body_dofadr[body], model.body_dofnum[body]
                weight[first : first + count] = LEG
                body = int(model.body_parentid[body])
        return weight

    def _fastest(self) -> Array:
        """The speed limit of each degree of freedom, shape (nv,)."""
        most = np.full(self._model.nv, np.inf)
        most[self._robot.layout.dof] = self._robot.limits.velocity
        return most


def _solve(matrix: Array, wanted: Array, given: Sequence[int], to: Sequence[float]) -> Array:
    """The least-squares step (nv,) in which some degrees of freedom go as far as is given."""
    matrix, wanted = matrix.copy(), wanted.copy()
    matrix[given, given] += HELD**2
    wanted[given] += HELD**2 * np.asarray(to)
    return np.linalg.solve(matrix, wanted).astype(np.float64, copy=False)
