"""Trains satellites together with weights of low rank, with few parameters.

1. The motion is decomposed into principal curves (singular vectors): curve j explains S_j^2 of the sum of squares, and
   V_ij^2 S_j^2 of it in channel i.
2. Satellites are ranked by orthogonal least squares for all curves together, with the gain of each for each curve.
3. A price per parameter determines a network: a channel has a share in a curve if V_ij^2 S_j^2 is above the price, a
   curve is a sum of the first satellites, up to the best number for the price, and a curve whose gain is below its cost
   is left out. Falling prices give a path of growing networks.
4. Akaike's criterion, or a bound on the number of parameters, selects a network of the path. The price of a weight of a
   curve, relative to a share, is not known before satellites have moved: three are tried.
5. Its satellites, frequencies and phases are optimised by variable projection, where the best weights of nested sums
   come from one Cholesky factor (its leading blocks are those of the shorter sums); then the shares are computed again.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from threadpoolctl import threadpool_limits

from controller.learning.centralized import satellite_learning
from controller.learning.centralized.model_choice import aicc
from controller.learning.centralized.satellite_learning import RIDGE_SHARE, WIDTHS, LearnedSatellites, learn_jointly
from controller.motion.rotations import Array, Flags, Indices
from controller.networks.centralized.centers import pairs_at, require_frequencies
from controller.networks.centralized.low_rank import LowRankWeights
from controller.networks.centralized.satellites import GaussianSatellites
from controller.networks.ridge import ridge
from motiondeck_base.errors import MotiondeckError

MOST_CURVES = 40
# A slow center uses a fraction of a turn, where satellites have to be sharper.
SHARPER = (*WIDTHS, 24.0, 48.0)
PRICES = np.geomspace(1e-13, 1e-2, 881)  # of a share, as parts of the motion's sum of squares
# Price of a weight of a curve, in shares: moved satellites need fewer weights, but not fewer shares.
WEIGHT_PRICES = (0.7, 1.5, 3.0)
KEPT = 2  # frequency vectors for the full optimisation


@dataclass(frozen=True, eq=False)
class LowRankNetwork:
    """Satellites with their centers, and W in two factors, for one motion."""

    satellites: LearnedSatellites
    weights: LowRankWeights

    def play(self, time: Array) -> Array:
        """The motion at times (K,), without its mean, shape (K, D)."""
        return self.satellites.respond(time) @ self.weights.matrix.T

    @property
    def numbers(self) -> int:
        """The number of stored parameters besides the mean: weights, satellites, frequencies and phases."""
        places = self.satellites.satellites.places
        return self.weights.numbers + places.size + len(places) + 2 * len(self.satellites.frequency)


@dataclass(frozen=True, eq=False)
class _Plan:
    """A network of the path: kept shares, their curves, and the number of satellites of each curve."""

    kept: Flags  # (D, r)
    curves: Indices  # (r,)
    used: Indices  # (r,)
    left: float  # of the sum of squares, about

    def numbers(self, centers: int) -> int:
        flags = -(-self.kept.size // 32)
        satellites = int(self.used.max()) * (2 * centers + 1)
        return int(self.kept.sum() + self.used.sum()) + len(self.used) + flags + satellites + 2 * centers


def learn_low_rank(
    target: Array,
    time: Array,
    starts: list[Array],
    satellites: int,
    *,
    parameters: int | None = None,
    independent: int | None = None,
    iterations: int = 200,
    move_frequencies: bool = True,
) -> LowRankNetwork:
    """A network with few weights for a motion (K, D) without its mean; its error is that of its satellites.

    Columns count by their size; `time` is that of each frame, shape (K,), s. MotiondeckError if there are too few
    frames for a satellite, or too few parameters for a curve, or nothing moves; FrequencyError names a bad center.

    Args:
        starts: frequency vectors to try, shape (n,) each, rad/s.
        satellites: m at most.
        parameters: at most this many; by default Akaike's criterion chooses.
        independent: effective sample size K for Akaike's criterion (default: all frames).
        iterations: of L-BFGS for each of KEPT frequency vectors.
        move_frequencies: whether frequencies and phases are optimised too; not for closed loops.
    """
    most = min(satellites, len(target) - 2)
    if most < 1:
        raise MotiondeckError(f"{len(target)} frames are too few to learn {satellites} satellites from")
    for frequency in starts:
        require_frequencies(frequency)
    if not target.any():
        raise MotiondeckError("nothing moves: there is no curve to learn")
    channels, independent = target.shape[1], independent or len(target)
    with threadpool_limits(1):
        left, size, directions = np.linalg.svd(target, full_matrices=False)
        leading = left[:, :MOST_CURVES] * size[:MOST_CURVES]
        best = satellite_learning.rank_frequencies(starts, leading, time, most)[:KEPT]
    curves = min(MOST_CURVES, int((size > 1e-9 * size[0]).sum()))
    scores, energy = left[:, :curves] * size[:curves], np.square(size[:curves])
    by_channel = np.square(size[:curves, None] * directions[:curves]).T
    thin = max(1, len(target) // max(300, 3 * most))

    def learned_at(frequency: Array, weight_price: float) -> LowRankNetwork:
        phase = np.zeros(len(frequency))
        states = pairs_at(frequency, phase, time)[::thin]
        count = min(most, len(states) - 1)
        ranked, explained = satellite_learning.rank_satellites(states, scores[::thin], count, SHARPER)
        explained = explained * energy / np.maximum(np.square(scores[::thin]).sum(0), 1e-300)
        plans = _path(by_channel, energy, explained, float(np.square(size).sum()), weight_price)
        plan = _chosen(plans, len(frequency), target.shape, parameters, independent)
        m = int(plan.used.max())
        start = LearnedSatellites(frequency, phase, GaussianSatellites(ranked.places[:m], ranked.sharpness[:m]), 0.0)
        # The weight of a curve is the norm of its kept shares.
        shares = np.where(plan.kept, directions[plan.curves].T, 0.0)
        wanted = scores[:, plan.curves] * np.linalg.norm(shares, axis=0)

        def read_out(response: Array, curves: Array) -> Array:
            return nested_readout(response, curves, plan.used)

        moved = learn_jointly(start, wanted, time, iterations, move_frequencies=move_frequencies, read_out=read_out)
        response = moved.respond(time)
        # Rounded as stored, curves first: the shares then compensate.
        curves_of = read_out(response, wanted).astype(np.float32).astype(np.float64)
        shares = _shares(response @ curves_of.T, target, plan.kept).astype(np.float32).astype(np.float64)
        weights = LowRankWeights(shares, curves_of)
        off = float(np.square(target - response @ weights.matrix.T).sum() / np.square(target).sum())
        return LowRankNetwork(LearnedSatellites(moved.frequency, moved.phase, moved.satellites, off), weights)

    with threadpool_limits(1):
        found = [learned_at(frequency, price) for frequency in best for price in WEIGHT_PRICES]
    if parameters is not None:
        return min(found, key=lambda network: network.satellites.error)
    whole, seen = float(np.square(target).sum()), independent * channels
    scale = seen / target.size
    return min(found, key=lambda one: aicc(one.satellites.error * whole * scale, seen, one.numbers + channels))


def _path(by_channel: Array, energy: Array, explained: Array, whole: float, weight_price: float) -> list[_Plan]:
    """Networks of rising size, from parts of the sum of squares `whole`.

    These are parts `by_channel` and curve, shape (D, r), `energy` of each curve, shape (r,), and what is `explained` of
    each by each further satellite, shape (m, r). `weight_price` is that of a weight of a curve, in shares.
    """
    left = np.maximum(np.vstack([energy, energy - np.cumsum(explained, axis=0)]), 0.0)
    count = np.arange(len(left))[:, None]
    plans = []
    for price in PRICES * whole:
        kept = by_channel > price
        share = np.where(kept, by_channel, 0.0).sum(0) / energy
        used = (share * left + weight_price * price * count).argmin(0)
        gain = share * (energy - np.take_along_axis(left, used[None], 0)[0])
        worth = np.flatnonzero((gain > price * (kept.sum(0) + weight_price * used)) & (used > 0))
        if len(worth):
            plans.append(_Plan(kept[:, worth], worth, used[worth], whole - float(gain[worth].sum())))
    return plans


def _chosen(
    plans: list[_Plan], centers: int, shape: tuple[int, ...], parameters: int | None, independent: int
) -> _Plan:
    if parameters is None:
        frames, channels = shape
        scale = independent / frames

        def criterion(plan: _Plan) -> float:
            return aicc(plan.left * scale, independent * channels, plan.numbers(centers) + channels)

        best = min(plans, key=criterion)
        return best if np.isfinite(criterion(best)) else plans[-1]
    for plan in plans:
        if plan.numbers(centers) <= parameters:
            return plan
    raise MotiondeckError(f"{parameters} parameters are too few; the smallest network has {plans[-1].numbers(centers)}")


def nested_readout(response: Array, target: Array, used: Indices) -> Array:
    """Weights (r, m): column j of a target (K, r) is a ridge sum of the first used[j] responses (K, m), 0 beyond."""
    gram = response.T @ response
    gram[np.diag_indices(len(gram))] += RIDGE_SHARE * len(response)
    lower = cholesky(gram, lower=True)
    half = solve_triangular(lower, response.T @ target, lower=True)
    weights = np.zeros(half.shape)
    for count in np.unique(used):
        these = used == count
        weights[:count, these] = solve_triangular(lower[:count, :count], half[:count, these], lower=True, trans=1)
    return weights.T


def _shares(curves: Array, target: Array, kept: Flags) -> Array:
    """The shares of the channels of a target (K, D) in their kept curves (K, r), shape (D, r)."""
    shares = np.zeros(kept.shape)
    regulariser = 1e-9 * float(np.square(curves).sum())
    for channel, these in enumerate(kept):
        if these.any():
            shares[channel, these] = ridge(curves[:, these], target[:, channel, None], regulariser)[0]
    return shares
