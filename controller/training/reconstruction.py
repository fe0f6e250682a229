"""Fills in markers that are missing for a while from those that are there (Vakulenko et al. 2017, section 4).

Centers and satellites are learned from the markers that are there all the time. What these say together moves in few
directions, the scores; a marker that comes and goes is a weighted sum of the scores, with weights learned where it is
seen. So it is the frequencies and satellites of the others that tell where it was.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from controller.errors import MotiondeckError
from controller.rotations import Array
from controller.training.ridge import ridge
from controller.training.satellite_learning import learn, ridge_readout, slow_and_fast

CENTERS = 2
SATELLITES_A_SECOND = 12.0
MOST_SATELLITES = 100
TRIES = 20
ITERATIONS = 60
SCORES = 24
RIDGE_SHARE = 1e-6

FEWEST_SEEN = 30


def fill_missing(markers: Array, rate: float) -> Array:
    """The same markers with nothing missing.

    Args:
        markers: shape (K, M, 3); all three coordinates of a missing one are NaN.
        rate: frames per second.

    Raises:
        MotiondeckError: if no marker is there all the time, or one is seen in fewer than FEWEST_SEEN frames.
    """
    seen: NDArray[np.bool_] = np.asarray(np.isfinite(markers).all(axis=-1))
    always = seen.all(axis=0)
    if not always.any():
        raise MotiondeckError("no marker is there all the time, so there is nothing to fill in the others from")
    hardly = np.flatnonzero(seen.sum(0) < FEWEST_SEEN)
    if len(hardly):
        raise MotiondeckError(f"marker {hardly[0]} is seen in fewer than {FEWEST_SEEN} frames")
    scores = _scores(markers[:, always].reshape(len(markers), -1), rate)
    filled = markers.copy()
    for marker in np.flatnonzero(~always):
        missing: NDArray[np.bool_] = ~seen[:, marker]
        there = markers[~missing, marker]
        weights = ridge(scores[~missing], there - there.mean(0), RIDGE_SHARE * len(there))
        said = scores @ weights.T + there.mean(0)
        filled[missing, marker] = said[missing]
        _meet_edges(filled[:, marker], said, missing)
    return filled


def _scores(flat: Array, rate: float) -> Array:
    """What a network of their own says of coordinates (K, F) in its SCORES strongest directions, shape (K, SCORES)."""
    time = np.arange(len(flat)) / rate
    target = flat - flat.mean(0)
    satellites = int(np.clip(SATELLITES_A_SECOND * time[-1], 4, min(MOST_SATELLITES, len(flat) // 3)))
    starts = slow_and_fast(float(time[-1]), CENTERS, TRIES, 0)
    learned = learn(target, time, satellites, starts, iterations=ITERATIONS)
    response = learned.respond(time)
    said = response @ ridge_readout(response, target).T
    left, size, _ = np.linalg.svd(said, full_matrices=False)
    return left[:, :SCORES] * size[:SCORES] / size[0]


def _meet_edges(path: Array, said: Array, missing: NDArray[np.bool_]) -> None:
    """Moves what fills a gap so that it meets the marker on both sides, by a straight line over the gap."""
    change = np.flatnonzero(np.diff(np.concatenate([[0], missing.astype(np.int8), [0]])))
    for first, end in change.reshape(-1, 2):
        before = path[first - 1] - said[first - 1] if first else None
        after = path[end] - said[end] if end < len(path) else None
        if before is None and after is None:
            continue
        low, high = (after if before is None else before), (before if after is None else after)
        share = (np.arange(first, end) - first + 1.0)[:, None] / (end - first + 1.0)
        path[first:end] += (1.0 - share) * low + share * high
