"""Accuracy measures of centralized networks, and Akaike's criterion for their size (Vakulenko 2017)."""

import numpy as np

from controller.motion.rotations import Array


def relative_accuracy(output: Array, markers: Array) -> Array:
    """The integral relative accuracy of each marker (eqs 20-26), shape (M,).

    It depends on the origin: a marker near it has a small sum of squares. So report mm as well. A coordinate that is
    constantly 0 (a joint of a taught rig turns about one axis) is ignored. Shapes (K, M, 3), in the same unit.
    """
    missed = np.square(markers - output).sum(0)
    size = np.square(markers).sum(0)
    return np.sqrt(np.divide(missed, size, out=np.zeros_like(missed), where=size > 0.0).mean(-1))


def mean_absolute(output: Array, markers: Array) -> float:
    """The mean absolute error of a coordinate: most likely the paper's error in mm."""
    return float(np.abs(output - markers).mean())


def mean_distance(output: Array, markers: Array) -> float:
    """The mean distance of markers (K, M, 3) from their targets."""
    return float(np.linalg.norm(output - markers, axis=-1).mean())


def aicc(squared_error: float, samples: int, parameters: int) -> float:
    """Akaike's information criterion for small samples, K ln(SSE/K) + 2 p + 2 p (p + 1) / (K - p - 1); lower is better.

    Residuals of motions are correlated in time, which favours many satellites: always report the frame rate with it. It
    is infinite for too few samples.
    """
    if samples <= parameters + 1:
        return np.inf
    correction = 2.0 * parameters * (parameters + 1) / (samples - parameters - 1)
    return float(samples * np.log(max(squared_error, 1e-300) / samples) + 2.0 * parameters + correction)
