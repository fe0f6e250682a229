"""Coupled joints: which joints of a robot follow another one, by an equality constraint of its model."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

import mujoco
import numpy as np


def followers(model: mujoco.MjModel) -> dict[int, tuple[int, np.ndarray]]:
    """The joints that an active equality constraint couples to another one, or holds where they are.

    Returns:
        joint -> (leader, the five coefficients of its position as a polynomial of the leader's); a joint that is held
        leads itself, by a constant.
    """
    coupled = {}
    for equality in np.flatnonzero((model.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (model.eq_active0 != 0)):
        follower, leader = int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])
        # MuJoCo's positions count from qpos0 here: y - y0 = p(x - x0).
        curve, start = model.eq_data[equality, :5], model.qpos0[model.jnt_qposadr[follower]]
        polynomial = np.zeros(5)
        if leader < 0:
            leader, polynomial[0] = follower, start + curve[0]
        else:
            from numpy.polynomial import Polynomial  # few models need it, and it is slow to import

            moved = Polynomial(curve)(Polynomial([-model.qpos0[model.jnt_qposadr[leader]], 1.0])).coef
            polynomial[: len(moved)] = moved
            polynomial[0] += start
        coupled[follower] = (leader, polynomial)
    return coupled
