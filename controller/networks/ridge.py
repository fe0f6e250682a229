"""Ridge regression (Deliallisi 2017, eqs 2.4, 3.12, 3.13)."""

import numpy as np

from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError


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
        raise MotiondeckError(
            f"ridge regression with a regulariser of {regulariser}: give finite numbers, none below 0"
        )
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
        raise MotiondeckError(
            f"states that do not differ enough for a regulariser of {regulariser:g}; give a larger one"
        ) from None


def affine_ridge(states: Array, targets: Array, regulariser: float, weight: Array | None = None) -> Array:
    """(W, w) with targets ~ W states + w by weighted ridge regression, w not regularised, shape (C, N + 1)."""
    centre, middle = (np.average(a, axis=0, weights=weight) for a in (states, targets))
    root = 1.0 if weight is None else np.sqrt(weight)[:, None]
    weights = ridge(root * (states - centre), root * (targets - middle), regulariser)
    return np.column_stack([weights, middle - weights @ centre])
