"""Trains positions and sharpness of satellites, together with frequencies and phases.

1. Greedy orthogonal least squares (Chen, Cowan and Grant 1991, reference 18 of Vakulenko et al. 2017): candidates are
   states that the centers visit, with several widths; the one that explains most of the residual is added, m times.
2. Variable projection: positions, sharpness, frequencies and phases are optimised by L-BFGS while the weights W are
   eliminated by ridge regression. With J(theta) = min_W |Y - Phi W'|^2 + ridge |W|^2 the gradient needs only
   dJ/dPhi = -2 (Y - Phi W') W, because J is at its minimum in W. The objective is log J: J itself soon becomes so small
   that stopping criteria end too early.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from threadpoolctl import threadpool_limits

from controller.motion.rotations import Array
from controller.networks.centralized.centers import pairs_at, require_frequencies
from controller.networks.centralized.satellites import GaussianSatellites
from controller.networks.ridge import ridge
from motiondeck_base.errors import MotiondeckError

WIDTHS = (0.7, 1.5, 3.0, 6.0, 12.0)
RIDGE_SHARE = 1e-9

# Number of satellites, and approximate number of frames, for ranking frequencies.
FEW, THINNED = 25, 150

LEAST_NEW = 1e-6  # share outside the span of the chosen satellites, below which a candidate adds only rounding
LEAST_SHARPNESS, GREATEST_SHARPNESS = 0.05, 60.0

ReadOut = Callable[[Array, Array], Array]  # W, shape (D, m), from responses (K, m) and a target (K, D)


def principal_scores(target: Array, keep: int = 40) -> Array:
    """The first `keep` principal components of a target (K, D), or the target if it has fewer columns."""
    if target.shape[1] <= keep:
        return target
    left, size, _ = np.linalg.svd(target, full_matrices=False)
    return left[:, :keep] * size[:keep]


@dataclass(frozen=True, eq=False)
class LearnedSatellites:
    """Centers and satellites, in the 2 n coordinates of the centers, for one motion."""

    frequency: Array  # shape (n,), rad/s
    phase: Array  # shape (n,), rad
    satellites: GaussianSatellites
    error: float  # squared error over the motion's sum of squares

    def respond(self, time: Array) -> Array:
        """Phi at times (K,), shape (K, m)."""
        return self.satellites.respond(pairs_at(self.frequency, self.phase, time))


def choose_satellites(states: Array, target: Array, count: int) -> tuple[GaussianSatellites, float]:
    """The `count` best satellites of `rank_satellites` with its errors, and their relative squared error."""
    size = float(np.square(target).sum())
    satellites, explained = rank_satellites(states, target, count)
    left = size - float(explained.sum())
    spare = count - len(satellites)
    if spare:
        # Everything is explained already; the remaining satellites are spread over the visited states.
        places, sharpness = _candidates(states, count, WIDTHS)
        more = (np.arange(spare) * len(places)) // spare
        satellites = GaussianSatellites(
            np.concatenate([satellites.places, places[more]]), np.concatenate([satellites.sharpness, sharpness[more]])
        )
    return satellites, max(0.0, left / size) if size else 0.0


def rank_satellites(
    states: Array, target: Array, count: int, widths: tuple[float, ...] = WIDTHS
) -> tuple[GaussianSatellites, Array]:
    """At most `count` satellites, each with the largest gain after those before it; fewer if all is explained.

    For states of the centers (K, d), a motion (K, D) and candidate `widths` of the sharpness; MotiondeckError unless K
    is above `count`. With them the sum of squares of each column that each explains, shape (m, D).
    """
    if count >= len(states):
        raise MotiondeckError(f"{count} satellites cannot be chosen from {len(states)} frames")
    places, sharpness = _candidates(states, count, widths)
    response = GaussianSatellites(places, sharpness).respond(states)
    response /= np.linalg.norm(response, axis=0)
    gram, explained = response.T @ response, response.T @ target
    new = np.ones(len(places))
    basis = np.zeros((len(places), count))
    chosen: list[int] = []
    taken: list[Array] = []
    for k in range(count):
        gain = np.where(new > LEAST_NEW, np.square(explained).sum(1) / np.maximum(new, LEAST_NEW), -1.0)
        gain[chosen] = -1.0
        best = int(gain.argmax())
        if gain[best] < 0.0:
            break
        chosen.append(best)
        taken.append(np.square(explained[best]) / new[best])
        column = (gram[best] - basis[:, :k] @ basis[best, :k]) / np.sqrt(new[best])
        explained = explained - np.multiply.outer(column, explained[best] / np.sqrt(new[best]))
        new = new - np.square(column)
        basis[:, k] = column
    return GaussianSatellites(places[chosen], sharpness[chosen]), np.array(taken)


def _candidates(states: Array, count: int, widths: tuple[float, ...]) -> tuple[Array, Array]:
    """Visited states, with every width each: places (c, d) and sharpness (c,)."""
    places = np.repeat(states[:: 2 if len(states) >= 2 * count else 1], len(widths), axis=0)
    return places, np.tile(np.array(widths), len(places) // len(widths))


def learn_jointly(
    start: LearnedSatellites,
    target: Array,
    time: Array,
    iterations: int,
    *,
    move_frequencies: bool = True,
    read_out: ReadOut | None = None,
) -> LearnedSatellites:
    """Variable projection from a start for a target (K, D) at times (K,), s; never worse than the start.

    At most `iterations` of L-BFGS; without `move_frequencies` (for closed loops) frequencies and phases stay.
    `read_out` finds the best W for responses and target, by default by ridge regression.
    """
    scores = target if read_out is not None else principal_scores(target)
    problem = _Projection(start, scores, time, move_frequencies, read_out or ridge_readout)
    x = problem.pack(start)
    options = {"maxiter": iterations, "maxcor": 20, "ftol": 1e-12, "gtol": 1e-9}
    found = minimize(problem.loss, x, jac=True, method="L-BFGS-B", bounds=problem.bounds(), options=options)
    better = found.x if found.fun < problem.loss(x)[0] else x
    return problem.unpack(better)


def ridge_readout(response: Array, target: Array) -> Array:
    """W, shape (D, m), for responses (K, m), by ridge regression with RIDGE_SHARE."""
    return ridge(response, target, RIDGE_SHARE * len(response))


def slow_and_fast(duration: float, centers: int, tries: int, seed: int, *, turns: float = 12.0) -> list[Array]:
    """Candidate frequency vectors, shape (centers,) each: a slow center, which gives the phase, and faster ones.

    The slow center makes 1/4, 0.45 or one turn in the duration, the fast ones up to `turns`.
    """
    base = 2.0 * np.pi / duration
    slow = (0.25, 0.45, 1.0)
    if centers == 1:
        return [base * np.array([s]) for s in slow]
    rng = np.random.default_rng(seed)
    fast = np.exp(rng.uniform(np.log(1.1), np.log(turns), (tries, centers - 1)))
    if centers == 2:
        fast = np.geomspace(1.1, turns, tries)[:, None]
    return [base * np.append(slow[i % len(slow)], np.sort(row)) for i, row in enumerate(fast)]


def learn(
    target: Array,
    time: Array,
    count: int,
    starts: list[Array],
    *,
    keep: int = 2,
    iterations: int = 200,
    move_frequencies: bool = True,
) -> LearnedSatellites:
    """Ranks frequency vectors `starts` (n,), rad/s, then chooses and optimises `count` satellites for the best few.

    The target is a motion (K, D) at times (K,), s. The best `keep` vectors are optimised fully, each with `iterations`
    of L-BFGS; `move_frequencies` as in `learn_jointly`. MotiondeckError if there are fewer frames than satellites;
    FrequencyError names a bad center.
    """
    if count >= len(target):
        raise MotiondeckError(f"{count} satellites cannot be learned from {len(target)} frames")
    for frequency in starts:
        require_frequencies(frequency)
    # With matrices as small as these, two BLAS threads are slower than one.
    with threadpool_limits(1):
        scores = principal_scores(target)
        if not scores.any():
            # Any satellites are right, with weights of 0; the logarithm of the error would have no gradient.
            phase = np.zeros(len(starts[0]))
            chosen = choose_satellites(pairs_at(starts[0], phase, time), scores, count)
            return LearnedSatellites(starts[0], phase, *chosen)
        thin = max(1, len(scores) // max(300, 4 * count))
        found = []
        for frequency in rank_frequencies(starts, scores, time, count)[:keep]:
            phase = np.zeros(len(frequency))
            chosen = choose_satellites(pairs_at(frequency, phase, time[::thin]), scores[::thin], count)
            start = LearnedSatellites(frequency, phase, *chosen)
            found.append(learn_jointly(start, scores, time, iterations, move_frequencies=move_frequencies))
    return min(found, key=lambda learned: learned.error)


def rank_frequencies(starts: list[Array], scores: Array, time: Array, count: int) -> list[Array]:
    """Frequency vectors by their error with at most FEW of `count` satellites, the best first."""
    few = min(count, FEW)
    thin = max(1, len(scores) // max(THINNED, 3 * few))
    scores, time = scores[::thin], time[::thin]
    few = min(few, len(scores) - 1)
    return sorted(starts, key=lambda f: choose_satellites(pairs_at(f, np.zeros(len(f)), time), scores, few)[1])


class _Projection:
    """log J over (log frequency, phase, places, log sharpness), with its gradient."""

    def __init__(self, start: LearnedSatellites, target: Array, time: Array, move: bool, read_out: ReadOut) -> None:
        self.start, self.target, self.time, self.move, self.read_out = start, target, time, move, read_out
        self.states = pairs_at(start.frequency, start.phase, time)

    def pack(self, learned: LearnedSatellites) -> Array:
        parts = [learned.satellites.places.ravel(), np.log(learned.satellites.sharpness)]
        if self.move:
            parts += [np.log(learned.frequency), learned.phase]
        return np.concatenate(parts)

    def split(self, x: Array) -> tuple[GaussianSatellites, Array, Array]:
        m, d = self.start.satellites.places.shape
        satellites = GaussianSatellites(x[: m * d].reshape(m, d), np.exp(x[m * d : m * d + m]))
        if not self.move:
            return satellites, self.start.frequency, self.start.phase
        n = d // 2
        return satellites, np.exp(x[-2 * n : -n]), x[-n:]

    def bounds(self) -> list[tuple[float, float]]:
        m, d = self.start.satellites.places.shape
        bounds = [(-4.0, 4.0)] * (m * d) + [(np.log(LEAST_SHARPNESS), np.log(GREATEST_SHARPNESS))] * m
        if self.move:
            bounds += [(np.log(f) - 1.0, np.log(f) + 1.0) for f in self.start.frequency]
            bounds += [(-20.0, 20.0)] * (d // 2)
        return bounds

    def unpack(self, x: Array) -> LearnedSatellites:
        satellites, frequency, phase = self.split(x)
        response = LearnedSatellites(frequency, phase, satellites, 0.0).respond(self.time)
        left = self.target - response @ self.read_out(response, self.target).T
        error = float(np.square(left).sum() / np.square(self.target).sum())
        return LearnedSatellites(frequency, phase, satellites, error)

    def loss(self, x: Array) -> tuple[float, Array]:
        satellites, frequency, phase = self.split(x)
        places, square = satellites.places, np.square(satellites.sharpness)
        states = pairs_at(frequency, phase, self.time) if self.move else self.states
        distances = satellites.distances(states)
        response = np.exp(-0.5 * square * distances)
        weights = self.read_out(response, self.target)
        left = self.target - response @ weights.T
        value = float(np.square(left).sum()) + RIDGE_SHARE * len(response) * float(np.square(weights).sum())
        pull = (-2.0 / value) * (left @ weights) * response
        by_place = square[:, None] * (pull.T @ states - pull.sum(0)[:, None] * places)
        by_sharpness = -square * (pull * distances).sum(0)
        parts = [by_place.ravel(), by_sharpness]
        if self.move:
            by_state = (pull * square) @ places - (pull @ square)[:, None] * states
            # d(cos, sin) / d(angle) = (-sin, cos).
            by_angle = by_state[:, 1::2] * states[:, ::2] - by_state[:, ::2] * states[:, 1::2]
            parts += [frequency * (self.time @ by_angle), by_angle.sum(0)]
        return float(np.log(value)), np.concatenate(parts)
