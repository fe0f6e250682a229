"""How well a centralized network reproduces a motion, and how many satellites are worth it (Vakulenko 2017)."""

from __future__ import annotations

import numpy as np

from controller.motion.anatomy import anatomy
from controller.motion.rotations import Array
from controller.motion.skeleton import Skeleton


def hands_and_feet(skeleton: Skeleton) -> list[int]:
    """The bones that the paper looks at the ends of: feet and wrists, or what comes nearest to them.

    Of a body without them it is the first four bones.
    """
    body = anatomy(skeleton)
    found = [body.first(part, side) for part in ("foot", "hand") for side in ("right", "left")]
    bones = [bone for bone in found if bone is not None]
    return bones or list(range(min(4, len(skeleton))))


def relative_accuracy(output: Array, markers: Array) -> Array:
    """The integral relative accuracy of each marker (eqs 20-26), shape (M,).

    It depends on where the origin lies: a marker that stays near it has a small sum of squares. So say mm as well. A
    coordinate that is 0 throughout (a joint of a taught rig turns about one axis) has no share of its own to miss.

    Args:
        output, markers: shape (K, M, 3), the same unit.
    """
    missed = np.square(markers - output).sum(0)
    size = np.square(markers).sum(0)
    return np.sqrt(np.divide(missed, size, out=np.zeros_like(missed), where=size > 0.0).mean(-1))


def mean_absolute(output: Array, markers: Array) -> float:
    """The mean absolute error of a coordinate, in the unit given: most likely what the paper calls its mm."""
    return float(np.abs(output - markers).mean())


def mean_distance(output: Array, markers: Array) -> float:
    """The mean distance of a marker from where it should be, shape (K, M, 3), in the unit given."""
    return float(np.linalg.norm(output - markers, axis=-1).mean())


def aicc(squared_error: float, samples: int, parameters: int) -> float:
    """Akaike's information criterion for small samples, K ln(SSE/K) + 2 p + 2 p (p + 1) / (K - p - 1); lower is better.

    Residuals of motions hang together in time, so frames count for more than they are worth and the criterion favours
    many satellites: always say the frame rate with it. It is infinite where samples do not suffice.
    """
    if samples <= parameters + 1:
        return np.inf
    correction = 2.0 * parameters * (parameters + 1) / (samples - parameters - 1)
    return float(samples * np.log(max(squared_error, 1e-300) / samples) + 2.0 * parameters + correction)
