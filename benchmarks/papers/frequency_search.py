"""Searches the frequencies that suit a motion (Vakulenko et al. 2017, eqs 20-27), with fixed satellites.

Centers are q_i = sin(omega_i t) as in the paper (q(0) = 0). A vector of frequencies is judged by the squared error that
its satellites leave with the best weights. The exhaustive search goes over a grid for one or two centers; more centers
are searched at random. What it finds is refined by Nelder and Mead's method over frequencies and sharpness.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.linalg import blas, lapack
from scipy.optimize import minimize

from controller.learning.centralized.satellite_learning import principal_scores
from controller.motion.rotations import Array
from controller.networks.centralized.centers import require_frequencies
from motiondeck_base.errors import MotiondeckError

# Ranking solves normal equations; this share of the frames on their diagonal keeps them solvable.
RIDGE_SHARE = 1e-8

# Fewer frames than this many for each satellite let a wrong frequency look right.
FRAMES_PER_SATELLITE = 3
FEWEST_FRAMES = 200


@dataclass(frozen=True, eq=False)
class Candidate:
    """A vector of frequencies and what it is worth.

    Attributes:
        frequency: shape (n,), rad/s.
        sharpness: b of the satellites.
        error: squared error left over, as a share of the motion's sum of squares (on the frames of the search).
    """

    frequency: Array
    sharpness: float
    error: float


def frequency_grid(duration: float, count: int, turns: float = 16.0) -> Array:
    """Frequencies from one turn in a duration (s) to `turns` of them, evenly in their logarithm, shape (count,)."""
    return 2.0 * np.pi / duration * np.geomspace(1.0, turns, count)


def sines_at(frequency: Array, time: Array) -> Array:
    """q_i = sin(omega_i t), shape (K, n)."""
    return np.sin(np.multiply.outer(time, frequency))


class FrequencySearch:
    """Judges frequencies for one motion and one set of satellites.

    Args:
        target: the motion, shape (K, D).
        time: of each frame, shape (K,), s.
        places: of the satellites, shape (m, n).

    Raises:
        MotiondeckError: if there are fewer frames than satellites.
    """

    def __init__(self, target: Array, time: Array, places: Array) -> None:
        if len(target) <= len(places):
            raise MotiondeckError(f"{len(places)} satellites cannot be learned from {len(target)} frames")
        enough = max(FEWEST_FRAMES, FRAMES_PER_SATELLITE * len(places))
        stride = max(1, len(target) // enough)
        self.places = places
        self._time = time[::stride]
        self._target = np.asfortranarray(principal_scores(target[::stride]))
        self._size = float(np.square(self._target).sum())

    def exhaustive(self, frequencies: Array, sharpness: float) -> list[Candidate]:
        """Every set of n different frequencies out of (F,), best first; for one or two centers.

        Raises:
            MotiondeckError: for more than two centers.
        """
        n = self.places.shape[1]
        if n > 2:
            raise MotiondeckError(f"an exhaustive search over {n} centers takes too long; search at random")
        require_frequencies(frequencies)
        factors = [self._factor(frequencies, center, sharpness) for center in range(n)]
        found = []
        for chosen in combinations(range(len(frequencies)), n):
            response = factors[0][chosen[0]]
            if n == 2:
                response = response * factors[1][chosen[1]]
            found.append(Candidate(frequencies[list(chosen)], sharpness, self.error_of(response)))
        return sorted(found, key=lambda candidate: candidate.error)

    def at_random(self, low: float, high: float, tries: int, sharpness: float, seed: int) -> list[Candidate]:
        """Frequencies drawn between two (rad/s), evenly in their logarithm, slowest first; the best vector first."""
        rng = np.random.default_rng(seed)
        drawn = np.exp(rng.uniform(np.log(low), np.log(high), (tries, self.places.shape[1])))
        found = [Candidate(f, sharpness, self.judge(f, sharpness)) for f in np.sort(drawn, axis=1)]
        return sorted(found, key=lambda candidate: candidate.error)

    def refine(self, candidate: Candidate, evaluations: int = 80) -> Candidate:
        """Nelder and Mead's method from a candidate, over the logarithms of its frequencies and sharpness."""

        def error(x: Array) -> float:
            return self.judge(np.exp(x[:-1]), float(np.exp(x[-1])))

        start = np.log(np.append(candidate.frequency, candidate.sharpness))
        simplex = start + np.vstack([np.zeros(len(start)), 0.02 * np.eye(len(start))])
        found = minimize(
            error, start, method="Nelder-Mead", options={"maxfev": evaluations, "initial_simplex": simplex}
        )
        if found.fun >= candidate.error:
            return candidate
        return Candidate(np.exp(found.x[:-1]), float(np.exp(found.x[-1])), float(found.fun))

    def judge(self, frequency: Array, sharpness: float) -> float:
        """The share of the motion's sum of squares that frequencies (n,) leave over."""
        states = sines_at(frequency, self._time)
        square = np.square(states).sum(1)[:, None] + np.square(self.places).sum(1) - 2.0 * states @ self.places.T
        return self.error_of(np.exp(-0.5 * sharpness**2 * square))

    def error_of(self, response: Array) -> float:
        """The same for responses (K', m): |Y|^2 - |L^-1 Phi' Y|^2 over |Y|^2 with L L' = Phi' Phi."""
        gram = blas.dsyrk(1.0, response.T, lower=1)  # pyright: ignore[reportAttributeAccessIssue]
        gram[np.diag_indices(len(gram))] += RIDGE_SHARE * len(response)
        root, failed = lapack.dpotrf(gram, lower=1, overwrite_a=1)  # pyright: ignore[reportAttributeAccessIssue]
        if failed:
            return 1.0
        fitted = lapack.dtrtrs(root, response.T @ self._target, lower=1)[0]  # pyright: ignore[reportAttributeAccessIssue]
        return max(0.0, 1.0 - float(np.square(fitted).sum()) / self._size)

    def _factor(self, frequencies: Array, center: int, sharpness: float) -> Array:
        """What one center contributes to the Gaussians at each frequency, shape (F, K', m): they are products."""
        sines = np.sin(np.multiply.outer(frequencies, self._time))
        return np.exp(-0.5 * sharpness**2 * np.square(sines[:, :, None] - self.places[:, center]))


def readout(response: Array, target: Array) -> Array:
    """The weights W, shape (D, m), that fit target (K, D) best from responses (K, m), by singular values.

    Raises:
        MotiondeckError: if there are fewer frames than satellites.
    """
    if len(response) < response.shape[1]:
        raise MotiondeckError(f"{response.shape[1]} satellites cannot be learned from {len(response)} frames")
    return np.linalg.lstsq(response, target, rcond=1e-9)[0].T.astype(np.float64, copy=False)
