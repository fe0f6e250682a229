"""Momentum: the angular momentum of the played motion, and its softening where it would throw the body over.

A body of weight W on a centre of pressure p, whose angular momentum L about its centre of mass changes, falls like one
that stands on p + s,

    s = (L_y', -L_x') / W,        xi' = omega (xi - p - s)                                                      (10)

So by (2) the planned capture point moves by

    omega / W (mean of (L_y, -L_x) over the future, weighted by e^(-omega (t' - t)), less (L_y, -L_x) now)         (11)

An s that is longer than the sole throws the body over, whatever is planned. Punches do so with the long arms and quick
joints of a large robot. Where the mean of |s| around a time gets near half the length of the sole, the body plays the
mean of the motion just before and after, without delay: the preview knows what comes.

The angular momentum of swinging legs is compensated instead. That of a robot whose soles move by v_1 and v_2, while its
centre of mass keeps still, is nearly the same share of them ahead and aside:

    (L_y, -L_x) = -kappa (v_1 + v_2)                                                                            (13)

So a leg that speeds up throws the body by the s of (10), and by (2) the planned capture point moves, for each foot, by
the second of

    s = -kappa / W v',      omega integral from t of  e^(-omega (t' - t)) s(t') dt'                              (14)
"""

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from controller.motion.rotations import Array
from sim.models.gravity import GRAVITY
from sim.physics.walking.gait import Gait
from sim.physics.walking.steps import swing_ramps
from sim.physics.walking.whole_body import WholeBody

LIGHT, HEAVY = 0.5, 1.0  # root mean square of |s| from which a motion is softened, and softened fully, in half soles
AROUND, RATE = 0.3, 0.05  # its window before and after, and that of L', s
SOFT = 0.2  # window of the softened posture before and after, s, weighted by a triangle
MOST = 0.4  # largest shift of the planned capture point, in half soles
MOVES = 0.02  # displacement of a sole that measures kappa, heights of the root


class Momentum:
    """Momentum of a motion that is known ahead of the body."""

    softened: float = 0.0  # weight of the mean posture, 0 to 1

    def __init__(self, model: mujoco.MjModel, dt: float, ahead: float, omega: float, sole: float) -> None:
        """Args: a model with a free root; the tick, s; the preview, s; omega, 1/s; half the sole's length, m."""
        self._model, self._dt, self._omega, self._sole = model, dt, omega, sole
        self._root = int(model.jnt_bodyid[0])
        self._weight = float(model.body_subtreemass[self._root]) * GRAVITY
        self._data, self._before = mujoco.MjData(model), np.empty(0)
        self._past, soft, future = round(AROUND / dt), round(SOFT / dt), round(ahead / dt) + 1
        ticks = self._past + future
        # Row `_past` of each is now, the last one is the newest.
        self._velocity, self._spin, self._offset = np.zeros((ticks, model.nv)), np.zeros((ticks, 2)), np.zeros(ticks)
        self._near = slice(0, 2 * self._past + 1)
        self._near_weight = _triangle(self._past)
        mean = np.zeros(ticks)
        mean[self._past - soft : self._past + soft + 1] = _triangle(soft)
        # From now to the mean, by the velocities on the way to each tick.
        after = np.cumsum(mean[::-1])[::-1]
        self._to_mean = np.where(np.arange(ticks) > self._past, after, after - 1.0)
        self._to_mean[: self._past - soft + 1] = 0.0
        later = np.where(np.arange(ticks) >= self._past, np.exp(-omega * dt * (np.arange(ticks) - self._past)), 0.0)
        softer = np.convolve(later, _triangle(soft), mode="same")
        self._moves = later / later.sum() - np.eye(ticks)[self._past], softer / softer.sum() - mean

    def add(self, goal: Array) -> None:
        """Adds the next tick of the motion, a posture (nq,)."""
        model, data, dt = self._model, self._data, self._dt
        if not len(self._before):
            self._before = goal.copy()
        mujoco.mj_differentiatePos(model, data.qvel, dt, self._before, goal)
        self._before[:] = data.qpos[:] = goal
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        for rows in (self._velocity, self._spin, self._offset):
            rows[:-1] = rows[1:]
        x, y, _ = data.subtree_angmom[self._root]
        self._velocity[-1], self._spin[-1] = data.qvel, (y, -x)
        turned = self._spin[-1] - self._spin[-1 - round(RATE / dt)]
        self._offset[-1] = float(turned @ turned) / (RATE * self._weight) ** 2
        offset = float(np.sqrt(self._near_weight @ self._offset[self._near])) / self._sole
        self.softened = min(max((offset - LIGHT) / (HEAVY - LIGHT), 0.0), 1.0)

    def soften(self, posture: Array) -> None:
        """Softens the present posture (nq,) of the motion."""
        if self.softened > 0.0:
            way = self.softened * (self._to_mean @ self._velocity)
            mujoco.mj_integratePos(self._model, posture, way, self._dt)

    @property
    def shift(self) -> Array:
        """Shift of the planned capture point, (2,), m: (11) while the motion is softened, else zero."""
        share = self.softened
        if share == 0.0:
            return np.zeros(2)
        as_played, softer = self._moves
        shift = share * self._omega / self._weight * (((1.0 - share) * as_played + share * softer) @ self._spin)
        return shift * min(1.0, MOST * self._sole / max(float(np.hypot(*shift)), 1e-9))


def _triangle(half: int) -> Array:
    """Weights of 2 half + 1 ticks that sum to 1, the most in the middle."""
    weights = np.bartlett(2 * half + 3)[1:-1]
    return weights / weights.sum()


def legs_carry(
    model: mujoco.MjModel, body: WholeBody, goal: Array, places: Sequence[Array], turns: Sequence[Array], centre: Array
) -> float:
    """kappa of (13), kg m, in the posture of `body`, which is kept; the other arguments are those of `step`."""
    plan, root, far = body.plan, int(model.jnt_bodyid[0]), MOVES * float(goal[2])
    before, jacobian, shares = plan.qpos.copy(), body.jacobian.copy(), np.empty((2, 2))
    for foot, axis in np.ndindex(2, 2):
        moved = [place.copy() for place in places]
        moved[foot][axis] += far
        body.settle(goal, moved, turns, centre)
        mujoco.mj_differentiatePos(model, plan.qvel, 1.0, before, plan.qpos)
        plan.qpos[:] = before
        mujoco.mj_kinematics(model, plan)
        mujoco.mj_comPos(model, plan)
        mujoco.mj_comVel(model, plan)
        mujoco.mj_subtreeVel(model, plan)
        x, y, _ = plan.subtree_angmom[root]
        shares[foot, axis] = -(y, -x)[axis] / far
    plan.qvel[:], body.jacobian[:] = 0.0, jacobian
    return float(shares.mean())


def leg_swing(now: float, omega: float, carried: float, gait: Gait) -> tuple[Array, float, Array]:
    """(14) for the steps of a gait at a time, s, with omega, 1/s, and carried = kappa / W, s^2.

    Shift of the planned capture point (2,), m, its change by the present step's length, and s (2,), m.
    """
    shift, arm, along = np.zeros(2), np.zeros(2), 0.0
    landed: list[Array | None] = [None, None]
    for step in gait.coming:
        begun = landed[step.foot]
        if begun is None:
            begun = gait.swing(now)[0] if step is gait.step else gait.places[step.foot]
        way = step.place - begun
        turns, squared = swing_ramps(step.start, step.end)
        thrown = -carried / squared
        leaves, even, slows, lands = [math.exp(-omega * max(turn - now, 0.0)) for turn in turns]
        moved = thrown * (leaves - even - slows + lands)
        shift += moved * way
        arm += thrown * (float(turns[0] <= now < turns[1]) - float(turns[2] <= now < turns[3])) * way
        # A later step of the same foot begins as much farther as it ends.
        along += moved if landed[step.foot] is None else 0.0
        landed[step.foot] = step.place
    return shift, along, arm
