"""What a robot's arms can do, by a search of its own: the best angles of an arm's hinges within their ranges.

Seen from the chest, upper arm and forearm k of a robot point to R(a_1, q_1) ... R(a_n, q_n) d_k, with the axes a of the
arm with all hinges at zero, those above it. Of angles spread over the ranges the best are improved by random steps that
shrink; upper arm and forearm count alike, by the sum of 1 - cos.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

Array = NDArray[np.float64]

SPREAD, FEW = 12, 4  # exponent of 2 of the first angles; number of the best that are improved
STEPS, WIDE, NARROW, TRIES = 24, 0.5, 0.004, 24  # random steps: rounds, first and last size, rad, number a round


class ArmReach:
    """One arm of n hinges below a chest."""

    def __init__(self, model: mujoco.MjModel, joints: list[int], chest: int, lines: list[tuple[int, Array]]) -> None:
        """Args: hinges from the shoulder on; body of the chest; body and direction (3,) of upper arm and forearm."""
        data = mujoco.MjData(model)
        data.qpos[model.jnt_qposadr[joints]] = 0.0
        mujoco.mj_kinematics(model, data)
        self.chest, seen = chest, data.xmat[chest].reshape(3, 3).T
        self._axis = data.xaxis[joints] @ seen.T
        self._line = np.array([seen @ data.xmat[body].reshape(3, 3) @ line for body, line in lines])
        self._turns = np.array([[_hangs(model, body, joint) for body, _ in lines] for joint in joints])
        limited = model.jnt_limited[joints].astype(bool)
        self._lower, self._upper = np.where(limited[:, None], model.jnt_range[joints], [-np.pi, np.pi]).T
        spread = qmc.Sobol(len(joints), scramble=False).random_base2(SPREAD)
        self._first = self._lower + spread * (self._upper - self._lower)
        self._there = self._lines(self._first)

    def __call__(self, goals: Array) -> Array:
        """Angles of upper arm and forearm to goals (F, 2, 3), seen from the chest, best, shape (F, 2), degrees."""
        chance = np.random.default_rng(1)
        alike = goals.reshape(len(goals), -1) @ self._there.reshape(len(self._there), -1).T
        start = np.argpartition(-alike, FEW, axis=1)[:, :FEW].ravel()
        q, wanted = self._first[start], np.repeat(goals, FEW, axis=0)
        rows = np.arange(len(q))
        for size in np.geomspace(WIDE, NARROW, STEPS):
            tried = q[:, None] + size * chance.standard_normal((len(q), TRIES, q.shape[1]))
            tried[:, 0] = q
            tried = np.clip(tried, self._lower, self._upper)
            there = self._lines(tried.reshape(-1, q.shape[1])).reshape(len(q), TRIES, 2, 3)
            q = tried[rows, np.argmax(np.einsum("ftki,fki->ft", there, wanted), axis=1)]
        cosine = np.einsum("fki,fki->fk", self._lines(q), wanted).reshape(len(goals), FEW, 2)
        best = cosine[np.arange(len(goals)), np.argmax(cosine.sum(axis=2), axis=1)]
        angles: Array = np.degrees(np.arccos(np.clip(best, -1.0, 1.0)))
        return angles

    def _lines(self, q: Array) -> Array:
        """The directions (F, 2, 3) at angles (F, n)."""
        found = np.tile(self._line, (len(q), 1, 1))
        for axis, turns, angle in reversed([*zip(self._axis, self._turns, q.T, strict=True)]):
            cosine, sine = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
            along = (found @ axis)[..., None] * axis
            turned = along + cosine * (found - along) + sine * np.cross(axis, found)
            found = np.where(turns[:, None], turned, found)
        return found


def _hangs(model: mujoco.MjModel, body: int, joint: int) -> bool:
    """Whether a body hangs below a joint."""
    while body and body != model.jnt_bodyid[joint]:
        body = int(model.body_parentid[body])
    return body != 0
