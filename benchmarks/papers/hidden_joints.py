"""Hides joints or markers for a while, fills them in, and measures the errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from controller.learning.centralized.reconstruction import fill_missing
from controller.motion.rotations import Array

# How much of a path a cubic is laid through on each side of a gap, s.
NEAR_S = 0.25


@dataclass(frozen=True)
class Missed:
    """Mean absolute errors of a coordinate in gaps, in the unit of the places.

    Attributes:
        filled: as `fill_missing` fills them, by the network, components or path that hidden stretches favour.
        cubic: by a cubic spline through the path on both sides.
        line: by a straight line.
        mean: by the mean place, as seen from the middle of the others.
    """

    filled: float
    cubic: float
    line: float
    mean: float


def fill_hidden(places: Array, which: int, starts: list[int], gap: int, rate: float) -> Missed:
    """Hides one of M joints or markers in some gaps at once and fills them in.

    Args:
        places: shape (K, M, 3); NaN where a marker is missing anyway, but not where it is hidden or near that.
        which: of them is hidden.
        starts: frames in which the gaps begin; there are at least two more on both sides.
        gap: how many frames each lasts.
        rate: frames per second.
    """
    hidden = places.copy()
    for first in starts:
        hidden[first : first + gap, which] = np.nan
    filled = fill_missing(hidden, rate)[0]
    near = max(2, round(NEAR_S * rate))
    path = places[:, which]
    middle = np.nanmean(np.delete(places, which, axis=1), axis=1)
    seen_from_it = np.nanmean(hidden[:, which] - middle, axis=0)
    missed = []
    for first in starts:
        inside = np.arange(first, first + gap)
        around = np.arange(first - near, first + gap + near)
        around = around[(around >= 0) & (around < len(path)) & ((around < first) | (around >= first + gap))]
        around = around[np.isfinite(hidden[around, which, 0])]
        edges = [first - 1, first + gap]
        ways = (
            filled[inside, which],
            CubicSpline(around, path[around])(inside),
            np.stack([np.interp(inside, edges, path[edges, axis]) for axis in range(3)], axis=-1),
            middle[inside] + seen_from_it,
        )
        missed.append([float(np.abs(said - path[inside]).mean()) for said in ways])
    return Missed(*np.mean(missed, axis=0).tolist())
