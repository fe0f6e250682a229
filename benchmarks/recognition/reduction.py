"""Fewer dimensions: which channels to keep, or which linear combinations (the proposal's section 4).

Each function looks at frames (T, C) of the learned motions and gives a matrix (C, k): reduced = frames @ matrix.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array

Reduce = Callable[[Array, int], Array]


def by_variance(frames: Array, keep: int) -> Array:
    """Keeps the channels that vary most."""
    return _picking(np.argsort(-frames.var(0), kind="stable")[:keep].astype(np.int64), frames.shape[1])


def by_conditional_entropy(frames: Array, keep: int) -> Array:
    """Drops, one by one, the channel that the remaining ones tell best.

    For Gaussian channels the entropy of one given the others is 0.5 log(2 pi e / p), p its diagonal entry of the
    inverse covariance. This finds channels that others cannot replace. Where channels are erratic, as Euler angles are,
    it prefers just those: use it on positions.
    """
    covariance = np.atleast_2d(np.cov(frames.T, bias=True))
    covariance += np.eye(len(covariance)) * (1e-6 * float(np.trace(covariance)) / len(covariance) + 1e-12)
    kept = np.arange(frames.shape[1])
    while len(kept) > keep:
        precision = np.diag(np.linalg.inv(covariance[np.ix_(kept, kept)]))
        kept = np.delete(kept, int(np.argmax(precision)))
    return _picking(kept, frames.shape[1])


def by_principal_axes(frames: Array, keep: int) -> Array:
    """Keeps the mixtures that vary most (principal component analysis)."""
    _, axes = np.linalg.eigh(np.atleast_2d(np.cov(frames.T, bias=True)))
    return np.ascontiguousarray(axes[:, ::-1][:, :keep])


def _picking(channels: NDArray[np.int64], count: int) -> Array:
    """The matrix that picks channels, in their own order."""
    return np.eye(count)[:, np.sort(channels)]


REDUCTIONS: dict[str, Reduce] = {
    "variance": by_variance,
    "conditional entropy": by_conditional_entropy,
    "principal axes": by_principal_axes,
}
