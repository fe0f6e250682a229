"""Predicts a marker from the others by principal components (Gloersen and Federolf 2016, PLoS ONE 11(3): e0152616).

Each coordinate is divided by its standard deviation and weighted by the distance d of its marker from the missing one,
w = exp((d0^2 - d^2) / 2 sigma^2), with d0 that of the nearest; the missing one has a small weight. With P the leading
components of the frames in which it is seen, and P0 those of the same frames with its coordinates set to zero, a frame
x0 in which they are zero becomes

    x = x0 P0 (P0^T P) P^T
"""

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array

NEAR = 0.4  # sigma, in root mean square distances of the markers from their centre; the paper's 200 mm
OWN_WEIGHT = 0.02  # of the missing marker
KEPT = (0.99, 0.999)
"""Shares of the sum of singular values that are tried."""


def by_components(others: Array, path: Array, missing: NDArray[np.bool_], kept: float) -> Array:
    """The path (K, 3) of a marker, predicted in every frame from M others (K, M, 3) about their centre.

    `path` may be anything where it is missing; it is seen in two frames and more. `kept` is the share of the sum of
    singular values that the components have.
    """
    seen = ~missing
    near = NEAR * np.sqrt(np.square(others).sum(-1).mean()) + 1e-12
    apart = np.linalg.norm(others[seen] - path[seen, None], axis=-1).mean(0)
    weight = np.exp(0.5 * (np.square(apart.min()) - np.square(apart)) / near**2)  # the nearest has weight 1
    weight = np.append(np.repeat(weight, 3), [OWN_WEIGHT] * 3)
    full = np.concatenate([others.reshape(len(others), -1), np.where(missing[:, None], 0.0, path)], axis=1)
    mean, scale = full[seen].mean(0), np.maximum(full[seen].std(0), 1e-9 * near) / weight
    full = (full - mean) / scale
    own = slice(full.shape[1] - 3, None)
    without = full.copy()
    without[:, own] = 0.0
    found = [np.linalg.svd(frames[seen], full_matrices=False)[1:] for frames in (without, full)]
    count = max(1 + int(np.searchsorted(np.cumsum(size), kept * size.sum())) for size, _ in found)
    axes_without, axes = (rows[:count] for _, rows in found)
    return (without @ axes_without.T @ (axes_without @ axes.T) @ axes)[:, own] * scale[own] + mean[own]
