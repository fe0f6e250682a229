"""Search: offsets of targets with which a robot follows a course on its own feet, by rollouts in a moving horizon.

From where the robot is, the offsets so far are simulated for some knots. Rollouts from changed states and offsets at
each knot show how the next state changes,

    dx_{k+1} = A_k dx_k + B_k dd_k

and a Riccati recursion gives the changes of the offsets d of the least cost (iLQR, Li and Todorov 2004)

    sum_k  |(x_k - r_k) / s|^2 + |d_k / s_d|^2 + |change of d_k / s_c|^2

for a course r. Of rollouts with shares of these changes the best is kept; its first knots are played, and the horizon
moves on. Rollouts are open loop: with the recursion's gains, a foot that rattles on the floor sets all
joints rattling. The same simulation plays and is searched, so that nothing that was found is lost.
"""

import numpy as np

from controller.motion.clip import between_rows
from controller.motion.rotations import Array
from sim.physical.course import Batch, CarriedCourse, played

NUDGE, NUDGE_RATE = 0.001, 0.02  # changes of positions and offsets (rad, m) and of velocities that are tried
SHARES = np.array([1.0, 0.6, 0.3, 0.1, 0.0])  # of the computed changes that are tried

# Deviations that cost 1 at a knot: of the root's place (m) and turn, and of joints (rad); of the root's velocity (m/s)
# and spin, and of joints' rates (rad/s); of offsets, and of their change in one improvement (rad).
PLACE, SPEED, OFFSET, CHANGE = (0.1, 0.1, 0.03, 0.1, 0.1, 0.1, 0.15), (0.3, 0.3, 0.3, 1.0, 1.0, 1.0, 2.0), 0.08, 0.02
END = 3.0  # factor over the cost at the end of the horizon
AHEAD, MOVES, BEGINS = 28, 2, 6  # knots of the horizon, by which it moves, and of that with which it begins
FITS = 2  # moves after which all rollouts are fitted anew; else those of knots that are new


def weights_of(nv: int) -> Array:
    """The cost of squared differences of states, shape (2 nv,)."""
    return np.array([*PLACE, *PLACE[-1:] * (nv - 7), *SPEED, *SPEED[-1:] * (nv - 7)]) ** -2.0


class Search:
    """Improves `offsets` (T, J) of a course, from knot to knot."""

    def __init__(self, batch: Batch, course: CarriedCourse) -> None:
        self._batch, self._course, nv, (knots, joints) = batch, course, batch.model.nv, course.targets.shape
        self._weights, self._price = weights_of(nv), OFFSET**-2.0
        self._changes = np.repeat([NUDGE, NUDGE_RATE], nv)
        self._fits = np.empty((knots, 2 * nv, 2 * nv + joints))  # A and B of the knots fitted so far
        self._fitted_to = self._moves = 0
        self._failed = False
        self.offsets = np.zeros((knots, joints))

    def improve(self, state: Array, now: int, ahead: int) -> None:
        """Improves the offsets of knots from `now` on, where the robot is at a state (n,)."""
        last = min(now + ahead, len(self._course.states) - 1)
        offsets = self.offsets[now:last]
        states = played(self._batch, self._course, state, now, offsets[None])[0]
        first = now if self._moves % FITS == 0 or self._failed else max(self._fitted_to, now)
        if first < last:
            self._fits[first:last] = self._fitted(states[first - now :], offsets[first - now :], first)
        self._fitted_to, self._moves = last, self._moves + 1
        tries = offsets + SHARES[:, None, None] * self._change(states, offsets, now)
        best = int(np.argmin(self._costs(played(self._batch, self._course, state, now, tries), tries, now)))
        self.offsets[now:last], self._failed = tries[best], SHARES[best] == 0.0
        self.offsets[last : last + MOVES] = tries[best, -1]  # a first guess

    def _costs(self, states: Array, offsets: Array, now: int) -> Array:
        """Of states (B, H + 1, n) with offsets (B, H, J), shape (B,)."""
        off = self._off(states[:, 1:], now)
        cost = (off * off) @ self._weights
        cost[:, -1] *= END
        total = cost.sum(axis=1) + self._price * np.square(offsets).sum(axis=(1, 2))
        return np.where(np.isfinite(total), total, np.inf)

    def _off(self, states: Array, now: int) -> Array:
        """Differences from the course to states (..., H, n) of the knots after `now`."""
        return self._batch.difference(self._course.states[now + 1 : now + 1 + states.shape[-2]], states)

    def _fitted(self, states: Array, offsets: Array, first: int) -> Array:
        """A and B (H, 2 nv, 2 nv + J) along states (H + 1, n) with offsets (H, J)."""
        batch, (knots, joints), width = self._batch, offsets.shape, len(self._changes)
        starts = np.repeat(states[:-1, None], width + joints + 1, axis=1)
        starts[:, :width] = batch.moved(starts[:, :width], np.diag(self._changes))
        controls = self._course.controls[first : first + knots] + offsets[:, None]
        controls = np.repeat(controls[:, None], width + joints + 1, axis=1)
        controls[:, width:-1] += NUDGE * np.eye(joints)[:, None]
        flat = starts.reshape(-1, starts.shape[-1]), controls.reshape(-1, 1, *controls.shape[2:])
        ends = batch(*flat).reshape(starts.shape)
        change = batch.difference(ends[:, -1:], ends[:, :-1])
        return (change / np.append(self._changes, np.full(joints, NUDGE))[:, None]).transpose(0, 2, 1)

    def _change(self, states: Array, offsets: Array, now: int) -> Array:
        """Changes of the offsets (H, J) of the least cost near these states (H + 1, n)."""
        off, weights, price = self._off(states[1:], now), self._weights, self._price
        fits = self._fits[now : now + len(offsets)]
        a, b = fits[..., : len(weights)], fits[..., len(weights) :]
        own, gains = np.empty_like(offsets), np.empty((*offsets.shape, len(weights)))
        dear = (price + CHANGE**-2.0) * np.eye(b.shape[2])
        slope, curve = END * weights * off[-1], np.diag(END * weights)
        for k in reversed(range(len(offsets))):
            along = b[k].T @ curve
            right = np.column_stack([b[k].T @ slope + price * offsets[k], along @ a[k]])
            solved = -np.linalg.solve(along @ b[k] + dear, right)
            own[k], gains[k] = solved[:, 0], solved[:, 1:]
            slope = a[k].T @ slope + gains[k].T @ right[:, 0]
            curve = a[k].T @ curve @ a[k] + right[:, 1:].T @ gains[k]
            curve = 0.5 * (curve + curve.T)
            if k:
                slope, curve = slope + weights * off[k - 1], curve + np.diag(weights)
        moved, change = np.zeros(len(weights)), np.empty_like(own)
        for k in range(len(offsets)):
            change[k] = own[k] + gains[k] @ moved
            moved = a[k] @ moved + b[k] @ change[k]
        return change


# Of `Sampling`: rollouts a move, nodes over the horizon, the standard deviation of their offsets (rad), and the
# difference of the mean cost of a knot by which a rollout counts a factor e less.
ROLLOUTS, NODES, SIGMA, TEMPERATURE = 64, 8, 0.03, 0.05


class Sampling(Search):
    """Improves offsets by random ones around them, weighted by their costs (MPPI, Williams et al. 2017).

    Offsets are linear between the nodes. It follows less closely than the fits, and stands where they fall.
    """

    def improve(self, state: Array, now: int, ahead: int) -> None:
        last = min(now + ahead, len(self._course.states) - 1)
        at, nodes = np.arange(now, last), np.linspace(now, last - 1, NODES)
        near = np.maximum(1.0 - np.abs(at[:, None] - nodes) / max(nodes[1] - nodes[0], 1e-9), 0.0)
        near /= near.sum(axis=1, keepdims=True)
        plan = between_rows(self.offsets[now:last], at, nodes)
        random = np.random.default_rng(now + ahead * len(self._course.states))
        drawn = plan + SIGMA * random.standard_normal((ROLLOUTS, *plan.shape))
        drawn[0] = plan
        tries = near @ drawn
        costs = self._costs(played(self._batch, self._course, state, now, tries), tries, now) / (last - now)
        weights = np.exp((min(costs.min(), 1e9) - costs) / TEMPERATURE)
        if weights.sum() > 0.0:  # else each rollout ends in NaN
            plan = np.tensordot(weights / weights.sum(), drawn, 1)
        self.offsets[now:last] = near @ plan
        self.offsets[last : last + MOVES] = self.offsets[last - 1]
