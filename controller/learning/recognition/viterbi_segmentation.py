"""Segments a stream by recognition: the class of each frame by Viterbi decoding of the experts' errors."""

import numpy as np

from controller.learning.recognition.experts import SMALLEST_ERROR, ExpertBank, frame_errors
from controller.motion.rotations import Array, Indices

# Cost of a change of class, in seconds of an expert with e times the error.
CHANGE_COST = 0.67


def frame_costs(bank: ExpertBank, signal: Array) -> Array:
    """The centred log error of each expert on each frame of a stream, shape (T, M); the first is as the second."""
    forced = bank.force([signal])[0]
    costs = np.log(np.maximum(frame_errors(bank.readouts, forced, bank.together), SMALLEST_ERROR)).mean(-1)
    costs = np.concatenate([np.repeat(costs[:1], len(signal) - len(costs), axis=0), costs])
    return costs - bank.centre


def viterbi(costs: Array, change: float) -> Indices:
    """The sequence of classes, shape (T,), that minimises the sum of its costs (T, M) plus `change` for each change."""
    frames, classes = costs.shape
    came_from = np.zeros((frames, classes), dtype=np.int64)
    best = costs[0].copy()
    for t in range(1, frames):
        cheapest = int(best.argmin())
        switch = best[cheapest] + change < best
        came_from[t] = np.where(switch, cheapest, np.arange(classes))
        best = np.where(switch, best[cheapest] + change, best) + costs[t]
    path = np.empty(frames, dtype=np.int64)
    path[-1] = best.argmin()
    for t in range(frames - 1, 0, -1):
        path[t - 1] = came_from[t, path[t]]
    return path


def borders_of(path: Indices) -> Indices:
    """The first frame of each new class in a sequence of classes."""
    return np.flatnonzero(np.diff(path)) + 1
