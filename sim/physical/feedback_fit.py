"""Fits feedback to simulations of a motion that was found.

Simulations with noise in u and in their states show by least squares how e goes on from block to block,

    e_{b+1} = A_b e_b + B_b u_b + c_b,      u_b = o_b + K_b e_b

and a Riccati recursion gives o and K of the least cost of e (`weights_of`) and u. A fit to many simulations sees what a
foot may meet, where a derivative sees one contact. It is repeated from where these lead; o is added to the controls.
"""

import numpy as np

from controller.motion.rotations import Array
from sim.physical.course import KNOT, played
from sim.physical.search import END, weights_of
from sim.physical.stage import OnItsFeet, PhysicalStage
from sim.physics.feedback import HOLD, MOST, STEP, Feedback, seen

KNOTS = round(HOLD * STEP / KNOT)  # of a block
PASSES, JUDGED_FROM = 6, 3  # the best pass is taken, of the last ones
RATE = 0.6  # share of a pass's o and K that is taken over
SIDE_BY_SIDE, JUDGED = 150, 48  # simulations that are fitted, and that judge a pass
FRESH = 60  # of them begin a block near the motion, the others near where they came to
NOISE = 0.03  # standard deviation of the noise in u, rad
PRICE = 60.0  # of u, 1/rad^2
LOST = 400.0  # cost of e from which it is not fitted
NEAR = (0.004, 0.1)  # standard deviations of positions (m, rad) and speeds beside the motion; of speeds in the others


def fitted_feedback(stage: PhysicalStage, found: OnItsFeet, seed: int = 0) -> tuple[Feedback, float]:
    """The feedback of a motion that a stage found, and the share of simulations near it that then stand."""
    fit, random, best = _Fit(stage, found), np.random.default_rng(seed), list[tuple[Feedback, float]]()
    for number in range(PASSES):
        fit.improve(random, RATE if number else 1.0)
        if number >= JUDGED_FROM:
            best.append((fit.feedback(), fit.stands(np.random.default_rng([seed, 1]))))
    return max(best, key=lambda one: one[1])


class _Fit:
    def __init__(self, stage: PhysicalStage, found: OnItsFeet) -> None:
        self._stage, self._batch, self._course, self._found = stage, stage.batch, stage.course, found
        self._nq, nv, (knots, joints) = self._batch.model.nq, self._batch.model.nv, found.targets.shape
        self._offsets = (found.targets - self._course.targets[:knots])[:-1]
        self._ends = [*range(0, knots - 1, KNOTS), knots - 1]
        self._states = found.states[self._ends]
        self._weights, self._price = weights_of(nv)[2:], PRICE * np.eye(joints)
        self._units = np.repeat([0.02, 0.3, NOISE, 1.0], [nv - 2, nv, joints, 1])
        blocks, width, inputs = len(self._ends) - 1, len(self._weights), len(self._units)
        self._own, self._gains = np.zeros((blocks, joints)), np.zeros((blocks, joints, width))
        self._sums = np.zeros((blocks, inputs, inputs + width))  # of the least squares

    def feedback(self) -> Feedback:
        own = np.repeat(self._own, KNOTS, axis=0)[: len(self._offsets)]
        controls = self._course.controls[: len(own)] + (self._offsets + own)[:, None]
        names = self._found.motion.joints
        return Feedback(names, controls.reshape(-1, len(names)), self._states[:-1], self._gains.copy())

    def improve(self, random: np.random.Generator, rate: float) -> None:
        states, inputs, fits = self._beside(random, self._states[0], SIDE_BY_SIDE), len(self._units), list[Array]()
        for block in range(len(self._own)):
            off, noise = self._off(states, block), NOISE * random.standard_normal((len(states), self._own.shape[1]))
            after = self._play(states, block, noise)[:, -1]
            new = self._off(after, block + 1)
            cost = np.square(new) @ self._weights
            weight = np.where(cost < LOST, 1.0 / (1.0 + cost / 100.0), 0.0)[:, None]
            given = np.column_stack([off, self._change(off, block) + noise, np.ones(len(states))]) / self._units
            # Those of earlier passes count less and less.
            self._sums[block] = 0.5 * self._sums[block] + (weight * given).T @ np.column_stack([given, new])
            fit = np.linalg.solve(self._sums[block, :, :inputs] + np.eye(inputs), self._sums[block, :, inputs:])
            fits.append((fit / self._units[:, None]).T)
            best = np.argsort(cost)[: max(8, int(0.7 * np.count_nonzero(weight)))]
            on = self._beside(random, after[random.choice(best, len(states) - FRESH)], len(states) - FRESH, 0.0)
            states = np.concatenate([on, self._beside(random, self._states[block + 1], FRESH)])
        weights, width = np.diag(self._weights), len(self._weights)
        curve, slope = END * weights, np.zeros(width)
        for block in reversed(range(len(fits))):
            a, b, c = np.split(fits[block], [width, inputs - 1], axis=1)
            along, rest = b.T @ curve, curve @ c[:, 0] + slope
            solved = -np.linalg.solve(along @ b + self._price, np.column_stack([along @ a, b.T @ rest]))
            self._gains[block] += rate * (solved[:, :-1] - self._gains[block])
            self._own[block] += rate * (np.clip(solved[:, -1], -0.5 * MOST, 0.5 * MOST) - self._own[block])
            own, gains = self._own[block], self._gains[block]
            a, c, priced = a + b @ gains, c[:, 0] + b @ own, gains.T @ self._price
            slope = a.T @ (curve @ c + slope) + priced @ own
            curve = a.T @ curve @ a + priced @ gains + weights

    def stands(self, random: np.random.Generator) -> float:
        """The share of simulations that stand to the end."""
        ways = [self._beside(random, self._states[0], JUDGED)[:, None]]
        for block in range(len(self._own)):
            ways.append(self._play(ways[-1][:, -1], block))
        return float(np.mean([self._stage.fallen(way, 0) is None for way in np.concatenate(ways, axis=1)]))

    def _beside(self, random: np.random.Generator, states: Array, count: int, places: float = 1.0) -> Array:
        spread = np.repeat([places * NEAR[0], NEAR[1]], self._batch.model.nv)
        return self._batch.moved(states, random.normal(0.0, spread, (count, len(spread))))

    def _off(self, states: Array, block: int) -> Array:
        return seen(states, self._nq) - seen(self._states[block], self._nq)

    def _change(self, off: Array, block: int) -> Array:
        return self._own[block] + np.clip(off @ self._gains[block].T, -MOST, MOST)

    def _play(self, states: Array, block: int, noise: Array | float = 0.0) -> Array:
        """States (B, H, n) after each knot of a block."""
        first, last = self._ends[block : block + 2]
        change = self._change(self._off(states, block), block) + noise
        after = played(self._batch, self._course, states, first, self._offsets[first:last] + change[:, None])
        return np.nan_to_num(after[:, 1:])
