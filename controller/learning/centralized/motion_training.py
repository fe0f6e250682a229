"""Trains a centralized network on one motion: rest, centers, satellites and weights, and chooses their numbers.

A loop gets a slow center with one turn in its period and fast ones with whole numbers of turns, so that the curve on
their torus is closed. A one-shot gets a slow center that starts with a quarter, 0.45 or one turn and is optimised too.
A movement primitive has common satellites for all demonstrations of a motion, and weights for each.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Literal

import numpy as np

from controller.learning.centralized.low_rank_learning import learn_low_rank
from controller.learning.centralized.model_choice import aicc
from controller.learning.centralized.satellite_learning import learn, ridge_readout, slow_and_fast
from controller.motion.clip import between_rows
from controller.motion.rotations import Array
from controller.networks.centralized.centralized import CentralizedMotion, channel_scale
from controller.networks.centralized.low_rank import LowRankWeights
from controller.networks.centralized.movement_primitive import MovementPrimitive
from controller.networks.signals import sampling_rate, time_series
from motiondeck_base.errors import MotiondeckError

LARGEST_WEIGHT = 1e3  # of normalised channels: larger weights are those of satellites that cancel each other
MOST_TURNS = 8
RATE = 30.0  # Hz, for criteria: neighbouring frames of faster recordings are redundant

Rank = Literal["full", "auto"]
FREQUENCY_TRIES = 30

CENTERS = (1, 2, 3)
SATELLITES = (9, 16, 25, 36, 49, 64, 81, 100)
COMPARED_ITERATIONS = 15  # of the refinement of compared networks

BEND = 0.3  # deviation of a channel from the demonstrations of a primitive, relative to its standard deviation


def train_centralized(
    channels: Array,
    rate: float,
    centers: int = 2,
    satellites: int = 49,
    *,
    loop: bool,
    rank: Rank = "full",
    iterations: int = 150,
    seed: int = 0,
) -> CentralizedMotion:
    """The network of one motion (K, D) at a rate, Hz, of a loop one period: its first frame follows the last.

    MotiondeckError if the motion is not of that shape, a number is not finite, there are fewer frames than satellites,
    or the weights grow beyond LARGEST_WEIGHT.

    Args:
        centers, satellites: n and m; with rank "auto", m at most.
        rank: of W; "auto" selects curves, satellites and shares by Akaike's criterion at 30 Hz.
        iterations: of the joint refinement of all satellites.
        seed: of the tried frequencies.
    """
    channels, rate = time_series(channels, "the motion"), sampling_rate(rate)
    if centers < 1 or satellites < 1:
        raise MotiondeckError(f"a network of {centers} centers and {satellites} satellites; it needs at least one each")
    frames = len(channels)
    seconds = frames / rate if loop else max(1, frames - 1) / rate
    time = np.arange(frames) / rate
    rest = channels.mean(0)
    scale = channel_scale(channels.std(0))
    target = (channels - rest) / scale
    starts = _closed(seconds, centers, seed) if loop else slow_and_fast(seconds, centers, FREQUENCY_TRIES, seed)
    weights: Array | LowRankWeights
    if rank == "auto" and target.any():
        seen = min(frames, round(seconds * RATE))
        sparse = learn_low_rank(
            target, time, starts, satellites, independent=seen, iterations=iterations, move_frequencies=not loop
        )
        learned, weights = sparse.satellites, sparse.weights
        shares = (scale[:, None] * weights.shares).astype(np.float32)  # as they are stored
        scaled = LowRankWeights(shares.astype(np.float64), weights.curves)
        largest = float(np.abs(weights.matrix).max())
    else:
        learned = learn(target, time, satellites, starts, iterations=iterations, move_frequencies=not loop)
        weights = ridge_readout(learned.respond(time), target)
        scaled = weights * scale[:, None]
        largest = float(np.abs(weights).max())
    if largest > LARGEST_WEIGHT:
        raise MotiondeckError(f"weights reach {largest:.0f}: {satellites} satellites are too many for {frames} frames")
    return CentralizedMotion(learned.frequency, learned.phase, learned.satellites, scaled, rest, seconds, loop)


def _closed(seconds: float, centers: int, seed: int) -> list[Array]:
    """Frequencies of whole turns in a period: one turn, and each choice of faster ones (at most a few dozen)."""
    base = 2.0 * np.pi / seconds
    choices = [np.array((1, *faster)) for faster in combinations(range(2, MOST_TURNS + centers), centers - 1)]
    if len(choices) > FREQUENCY_TRIES:
        drawn = np.random.default_rng(seed).choice(len(choices), FREQUENCY_TRIES, replace=False)
        choices = [choices[i] for i in sorted(drawn)]
    return [base * turns for turns in choices]


@dataclass(frozen=True)
class Scored:
    """One choice of sizes."""

    centers: int  # n
    satellites: int  # m
    aicc: float  # at RATE; the least is best
    error: float  # root mean square error over the standard deviation of the channels
    motion: CentralizedMotion


def score_models(
    channels: Array,
    rate: float,
    *,
    loop: bool,
    centers: Iterable[int] = CENTERS,
    satellites: Iterable[int] = SATELLITES,
    seed: int = 0,
) -> list[Scored]:
    """Every choice of sizes with enough frames for a motion (K, D), the best first by Akaike's criterion (fig. 13)."""
    stride = max(1, round(rate / RATE))
    seen = channels[::stride]
    time = np.arange(len(seen)) * stride / rate
    scale = channel_scale(channels.std(0))
    scored = []
    for n, m in product(centers, satellites):
        if m > len(channels) // 3 or m >= len(seen):
            continue
        try:
            motion = train_centralized(channels, rate, n, m, loop=loop, iterations=COMPARED_ITERATIONS, seed=seed)
        except MotiondeckError:
            continue  # its weights grow too large: too many satellites
        missed = float(np.square((motion.at(time) - seen) / scale).sum())
        parameters = (m + 1) * channels.shape[1] + m * (2 * n + 1) + 2 * n
        criterion = aicc(missed, seen.size, parameters)
        if np.isfinite(criterion):
            scored.append(Scored(n, m, criterion, float(np.sqrt(missed / seen.size)), motion))
    if not scored:
        raise MotiondeckError(f"{len(channels)} frames are too few to choose a network by")
    return sorted(scored, key=lambda one: one.aicc)


def learn_primitive(
    demonstrations: Sequence[Array], rate: float, *, satellites: int = 30, iterations: int = 100
) -> MovementPrimitive:
    """The primitive of demonstrations (K_i, D) of one motion at a rate, Hz, from the same first to the same last frame.

    It has `satellites`, at most a third of the frames of the shortest demonstration, and takes `iterations` of L-BFGS.
    MotiondeckError if there is none, one is too short, their channels differ or a number is not finite.
    """
    if len(demonstrations) == 0:
        raise MotiondeckError("a movement primitive needs one demonstration at least, two for a spread")
    rate = sampling_rate(rate)
    channels = time_series(demonstrations[0], "demonstration 0").shape[1]
    demonstrations = [time_series(one, f"demonstration {i}", channels) for i, one in enumerate(demonstrations)]
    for index, each in enumerate(demonstrations):
        if len(each) < 6:
            raise MotiondeckError(f"demonstration {index} is of shape {each.shape}; 6 frames are needed at least")
    frames = round(float(np.median([len(each) for each in demonstrations])))
    phase = np.linspace(0.0, 1.0, frames)
    aligned = np.stack([between_rows(each, np.linspace(0.0, 1.0, len(each)), phase) for each in demonstrations])
    rest, scale = aligned.mean((0, 1)), channel_scale(aligned.std((0, 1)))
    scaled = (aligned - rest) / scale
    side_by_side = scaled.transpose(1, 0, 2).reshape(frames, -1)
    count = max(1, min(satellites, min(len(each) for each in demonstrations) // 3))
    learned = learn(side_by_side, phase, count, slow_and_fast(1.0, 1, 1, 0), iterations=iterations)
    weights = ridge_readout(learned.respond(phase), side_by_side).reshape(len(aligned), channels, count)
    seconds = np.array([(len(each) - 1) / rate for each in demonstrations])
    weights = weights * scale[:, None]
    return MovementPrimitive(learned.frequency, learned.phase, learned.satellites, weights, rest, BEND * scale, seconds)
