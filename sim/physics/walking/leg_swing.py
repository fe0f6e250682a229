"""Leg swing: the angular momentum of swinging legs, and the shift of the planned capture point that compensates it.

The angular momentum L about the centre of mass of a robot whose soles move by v_1 and v_2, while its centre of mass
keeps still, is nearly the same share of them ahead and aside:

    (L_y, -L_x) = -kappa (v_1 + v_2)                                                                            (13)

So a leg that speeds up throws the body like a centre of pressure that is off by s, the one that (10) has, and by (2)
the planned capture point moves, for each foot, by the second of

    s = -kappa / W v',      omega integral from t of  e^(-omega (t' - t)) s(t') dt'                              (14)

with the weight W.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from controller.motion.rotations import Array
from sim.physics.walking.gait import Gait
from sim.physics.walking.steps import swing_ramps
from sim.physics.walking.whole_body import WholeBody

# Displacement of a sole that measures kappa, heights of the root.
MOVES = 0.02


class LegSwing(NamedTuple):
    """The effect of swinging legs.

    Attributes:
        shift: of the planned capture point, shape (2,), m.
        along: change of the shift by the present step's length.
        arm: s, shape (2,), m.
    """

    shift: Array
    along: float
    arm: Array


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


def leg_swing(now: float, omega: float, carried: float, gait: Gait) -> LegSwing:
    """(14) for the steps of a gait at a time, s, with omega, 1/s, and carried = kappa / W, s^2."""
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
    return LegSwing(shift, along, arm)
