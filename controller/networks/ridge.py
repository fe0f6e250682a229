"""Ridge regression (Deliallisi 2017, eqs 2.4, 3.12, 3.13)."""

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array, Indices
from motiondeck_base.errors import MotiondeckError

# Frames on either side of a seam and their weight for a readout, so that both pieces meet there.
SEAM_FRAMES, SEAM_WEIGHT = 3, 100.0


def ridge(states: Array, targets: Array, regulariser: float) -> Array:
    """The W, shape (C, N), that minimises |targets - states W'|^2 + regulariser |W|^2.

    For states (T, N) and targets (T, C). Solved in whichever of the two equivalent forms is smaller, N x N or T x T.
    MotiondeckError if shapes differ, a number is not finite, or the regulariser > 0 is too small to solve for W.
    """
    states, targets = np.asarray(states), np.asarray(targets)
    if states.ndim != 2 or targets.ndim not in (1, 2) or len(states) != len(targets):
        raise MotiondeckError(
            f"states of shape {states.shape} and targets of shape {targets.shape}; (frames, neurons) and (frames, "
            "channels) are needed, of equally many frames"
        )
    if not (regulariser >= 0.0 and np.isfinite(states).all() and np.isfinite(targets).all()):
        raise MotiondeckError(f"ridge regression with a regulariser of {regulariser}: give finite numbers >= 0")
    from scipy.linalg import cho_factor, cho_solve  # takes longer to import than a library takes to load

    frames, neurons = states.shape
    try:
        if frames < neurons:
            gram = states @ states.T
            gram[np.diag_indices(frames)] += regulariser
            return (states.T @ cho_solve(cho_factor(gram, overwrite_a=True), targets)).T
        gram = states.T @ states
        gram[np.diag_indices(neurons)] += regulariser
        return cho_solve(cho_factor(gram, overwrite_a=True), states.T @ targets).T
    except np.linalg.LinAlgError:
        raise MotiondeckError(f"states differ too little for a regulariser of {regulariser:g}; enlarge it") from None


def affine_ridge(states: Array, targets: Array, regulariser: float, weight: Array | None = None) -> Array:
    """(W, w) with targets ~ W states + w by weighted ridge regression, w not regularised, shape (C, N + 1)."""
    centre, middle = (np.average(a, axis=0, weights=weight) for a in (states, targets))
    root = 1.0 if weight is None else np.sqrt(weight)[:, None]
    weights = ridge(root * (states - centre), root * (targets - middle), regulariser)
    return np.column_stack([weights, middle - weights @ centre])


def learn_readouts(
    states: NDArray[np.float32], piece: Indices, frames: Array, regulariser: float
) -> NDArray[np.float32]:
    """A readout (R, r) of each piece, (P, C, k + 1), of settled states (T, k), frames (T, C) and their `piece` (T,)."""
    pieces = [np.flatnonzero(piece == one) for one in range(int(piece.max()) + 1)]
    weight = np.ones(len(frames))
    for own in pieces if len(pieces) > 1 else []:
        weight[own[:SEAM_FRAMES]] = weight[own[-SEAM_FRAMES:]] = SEAM_WEIGHT
    found = [affine_ridge(states[own].astype(np.float64), frames[own], regulariser, weight[own]) for own in pieces]
    # In the memory layout of a loaded network, which then plays bit by bit the same.
    return np.ascontiguousarray(np.stack(found), dtype=np.float32)
