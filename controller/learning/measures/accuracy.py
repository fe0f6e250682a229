"""The accuracy of a readout: Jaeger's normalised root mean square error."""

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError


def nrmse(output: Array, target: Array) -> float:
    """Mean over channels of sqrt(mean squared error / mean of both variances), the measure behind the thesis's tables.

    Eq. 3.3 of Deliallisi 2017 as printed divides by the variance of the error itself and is always about 1; the tables
    come from this definition. Both have shape (T, C), else a MotiondeckError; channels that never move are left out.
    """
    output, target = np.asarray(output), np.asarray(target)
    if output.shape != target.shape:
        raise MotiondeckError(f"an output of shape {output.shape} and a target of shape {target.shape} do not compare")
    variance = 0.5 * (output.var(0) + target.var(0))
    moving = target.var(0) > 1e-12
    if not moving.any():
        return 0.0
    squared = np.square(output - target).mean(0)[moving]
    return float(np.sqrt(squared / variance[moving]).mean())


def mabs(weights: NDArray[np.floating]) -> float:
    """The mean absolute value of a matrix (eq. 3.5): the smaller, the less a network overfits."""
    return float(np.abs(weights).mean())
