"""Borders of a recording by probabilistic PCA (Barbic et al. 2004, section 4), as a rival.

A Gaussian of the first K frames, whose covariance is the r principal directions that hold TAU of the variance and an
equal rest, is compared with the LOOK frames that follow: H is their mean squared Mahalanobis distance. K grows by STEP;
where H has fallen and then rises by R a border lies at the peak, and the search begins anew there. The figures are the
paper's but for R: with its 15, the quaternions of 14 joints give 19 borders for 6.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array

TAU, FIRST, LOOK, STEP = 0.95, 150, 150, 10


def ppca_borders(features: Array, rise: float) -> NDArray[np.int64]:
    """The borders, frames, of features (T, F) at 120 Hz, with R = `rise`."""
    borders: list[int] = []
    start = 0
    while (border := _next_border(features[start:], rise)) is not None:
        start += border
        borders.append(start)
    return np.array(borders, dtype=np.int64)


def _next_border(features: Array, rise: float) -> int | None:
    ends = range(FIRST, len(features) - LOOK + 1, STEP)
    lowest, highest, at, falling = np.inf, -np.inf, 0, True
    for end in ends:
        distance = _mean_distance(features[:end], features[end : end + LOOK])
        if falling:
            lowest = min(lowest, distance)
            if distance < lowest + rise:
                continue
            falling, highest, at = False, distance, end
        elif distance > highest:
            highest, at = distance, end
        elif distance < highest:
            return at
    return None


def _mean_distance(past: Array, ahead: Array) -> float:
    mean = past.mean(0)
    variance, axes = np.linalg.eigh(np.cov((past - mean).T))
    variance, axes = variance[::-1], axes[:, ::-1]
    kept = 1 + int(np.searchsorted(np.cumsum(variance) / variance.sum(), TAU))
    rest = max(float(variance[kept:].mean()), 1e-12) if kept < len(variance) else 1.0
    scaled = np.concatenate([variance[:kept], np.full(len(variance) - kept, rest)])
    return float((np.square((ahead - mean) @ axes) / scaled).sum(1).mean())
