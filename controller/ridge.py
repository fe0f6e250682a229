"""Ridge regression (Deliallisi 2017, eqs 2.4, 3.12, 3.13)."""

from __future__ import annotations

import numpy as np

from controller.rotations import Array


def ridge(states: Array, targets: Array, regulariser: float) -> Array:
    """The W, shape (C, N), that minimises |targets - states W'|^2 + regulariser |W|^2.

    Solved in whichever of the two equivalent forms is smaller, N x N or T x T.

    Args:
        states: shape (T, N).
        targets: shape (T, C).
        regulariser: gamma > 0.
    """
    from scipy.linalg import cho_factor, cho_solve  # takes longer to import than a library takes to load

    frames, neurons = states.shape
    if frames < neurons:
        gram = states @ states.T
        gram[np.diag_indices(frames)] += regulariser
        return (states.T @ cho_solve(cho_factor(gram, overwrite_a=True), targets)).T
    gram = states.T @ states
    gram[np.diag_indices(neurons)] += regulariser
    return cho_solve(cho_factor(gram, overwrite_a=True), states.T @ targets).T
