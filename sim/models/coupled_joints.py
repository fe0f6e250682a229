"""Coupled joints: followers and leaders by equality constraints of a model."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import mujoco
import numpy as np

from controller.motion.rotations import Array, Indices


@dataclass(frozen=True)
class LedJoints:
    """F joints that follow others."""

    follower: Indices  # joints, shape (F,)
    leader: Indices  # the joint that each follows
    curve: Array  # the coefficients of the followers' positions as polynomials of their leaders', shape (F, 5)

    @classmethod
    def of(cls, led: Mapping[int, tuple[int, Array]]) -> Self:
        """The followers of a mapping to their leaders and polynomials."""
        leaders = np.array([leader for leader, _ in led.values()], np.int64)
        return cls(np.array([*led], np.int64), leaders, np.array([curve for _, curve in led.values()]).reshape(-1, 5))

    def followed(self, leaders: Array) -> Array:
        """Positions of the followers for leaders at (F,), shape (F,)."""
        (a, b, c, d, e), x = self.curve.T, leaders
        return a + x * (b + x * (c + x * (d + x * e)))

    def slope(self, leaders: Array) -> Array:
        """Derivatives of the followers by their leaders at (F,), shape (F,)."""
        (_, b, c, d, e), x = self.curve.T, leaders
        return b + x * (2.0 * c + x * (3.0 * d + x * 4.0 * e))


def led_joints(model: mujoco.MjModel) -> tuple[LedJoints, ...]:
    """The followers in the order of placing: after their leaders."""
    waiting, layers = followers(model), []
    while waiting:
        now = {one: led for one, led in waiting.items() if led[0] == one or led[0] not in waiting}
        now = now or waiting  # a cycle
        layers.append(LedJoints.of(now))
        waiting = {one: led for one, led in waiting.items() if one not in now}
    return tuple(layers)


def followers(model: mujoco.MjModel) -> dict[int, tuple[int, np.ndarray]]:
    """Joints with an active equality constraint: joint -> (leader, the five coefficients of its polynomial)."""
    # A joint that is held leads itself, by a constant.
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
