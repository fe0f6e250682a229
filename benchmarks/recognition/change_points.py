"""Segments an unlabelled stream: by kernel change points, or by prediction errors across each frame.

kernel change points   the least scatter within segments, in a Gaussian kernel, plus a price per border; exact by
                       dynamic programming (Harchaoui and Cappe 2007)
cross-prediction       a readout trained on the seconds before a frame predicts the seconds after it, and vice versa; a
                       border is where both fail
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks
from scipy.spatial.distance import pdist, squareform

from controller.learning.recognition.experts import ExpertRecipe, Moments, expert_reservoir, force, readout
from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError

Frames = NDArray[np.int64]

BORDER_PRICE = 0.67  # s of frames that differ as much as frames can
KERNEL_RATE = 15.0  # Hz of the stream that suits the kernel
PREDICTION_RATE = 30.0  # Hz of the stream that suits the readouts
SHORTEST = 1.0  # s between two borders
LARGEST_GRAM = 4000  # frames; the kernel holds their square

WINDOW = 3.0  # s on each side of a frame
SURPRISE = 0.8  # log ratio of errors: across the frame over within a side


def kernel_change_points(signal: Array, rate: float, price: float = BORDER_PRICE) -> Frames:
    """Borders of a stream (T, C) at a rate in Hz: frames at which a new segment begins.

    The kernel is exp(-|a - b|^2 / (2 s^2)) with s^2 half the median squared distance of frames; a segment costs
    sum_t k(t, t) - (1/n) sum_st k(s, t), a border costs `price` seconds of the largest cost a frame can have.

    Raises:
        MotiondeckError: if the stream is too long to compare all pairs of its frames.
    """
    count = len(signal)
    if count > LARGEST_GRAM:
        raise MotiondeckError(
            f"{count} frames are too many for kernel change points (at most {LARGEST_GRAM}); lower the rate"
        )
    shortest = max(1, round(SHORTEST * rate))
    if count < 2 * shortest:
        return np.empty(0, dtype=np.int64)
    square = squareform(pdist(signal, "sqeuclidean"))
    scale = float(np.median(square[np.triu_indices(count, 1)]))
    gram = np.exp(-square / max(scale, 1e-12))
    # sums[i, j] = sum of gram[:i, :j]
    sums = np.zeros((count + 1, count + 1))
    sums[1:, 1:] = gram.cumsum(0).cumsum(1)
    diagonal = np.diag(sums)
    best = np.full(count + 1, np.inf)
    best[0] = 0.0
    before = np.zeros(count + 1, dtype=np.int64)
    for end in range(shortest, count + 1):
        start = np.arange(0, end - shortest + 1)
        length = end - start
        inside = diagonal[end] - 2.0 * sums[start, end] + diagonal[start]
        total = best[start] + length - inside / length + price * rate
        before[end] = start[int(total.argmin())]
        best[end] = total.min()
    borders: list[int] = []
    at = int(before[count])
    while at > 0:
        borders.append(at)
        at = int(before[at])
    return np.array(borders[::-1], dtype=np.int64)


def cross_prediction(
    signal: Array, rate: float, recipe: ExpertRecipe | None = None, surprise: float = SURPRISE
) -> Frames:
    """Borders of a stream (T, C) at a rate in Hz: frames across which prediction fails."""
    scores = cross_surprise(signal, rate, recipe or ExpertRecipe(neurons=30))
    peaks, _ = find_peaks(scores, height=surprise, distance=max(1, round(SHORTEST * rate)), prominence=0.3)
    return peaks.astype(np.int64)


def cross_surprise(signal: Array, rate: float, recipe: ExpertRecipe) -> Array:
    """The log ratio of prediction errors across each frame and within its sides, shape (T,).

    Zero where a side is shorter than a third of the window.
    """
    reservoir = expert_reservoir(recipe, signal.shape[1])
    forced = force(reservoir, [np.concatenate([signal[:1], signal])], 0)[0]
    x, y = forced.states, forced.targets
    window = max(2, round(WINDOW * rate))
    step = max(1, round(rate / 10.0))
    moments = np.arange(window // 3, len(y) - window // 3, step)
    scores = np.zeros(len(y))
    if len(moments) == 0:
        return scores
    values = np.empty(len(moments))
    for k, t in enumerate(moments):
        left, right = slice(max(0, t - window), t), slice(t, t + window)
        of_left, of_right = _readout(x[left], y[left], recipe), _readout(x[right], y[right], recipe)
        surprise = 0.0
        for own, other, side in ((of_left, of_right, left), (of_right, of_left, right)):
            surprise += 0.5 * np.log(_error(other, x[side], y[side]) / _error(own, x[side], y[side]))
        values[k] = surprise
    return np.interp(np.arange(len(y)), moments, values)


def _readout(x: Array, y: Array, recipe: ExpertRecipe) -> Array:
    return readout(Moments(x.T @ x, x.T @ y, np.zeros(y.shape[1]), 1.0), recipe.ridge)


def _error(weights: Array, x: Array, y: Array) -> float:
    return float(np.square(y - x @ weights.T).mean()) + 1e-6
