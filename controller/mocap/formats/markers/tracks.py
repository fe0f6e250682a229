"""Where markers were seen, whatever file they came from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.rotations import Array

UNITS = {"mm": 0.001, "cm": 0.01, "dm": 0.1, "m": 1.0, "in": 0.0254, "inch": 0.0254, "inches": 0.0254, "ft": 0.3048}
"""What marker files call their unit, m."""
FARTHEST = 1e4  # m: a point beyond is a broken number


@dataclass(frozen=True, eq=False)
class Markers:
    """T frames of M points.

    Attributes:
        labels: of the points, as the file writes them.
        rate: frames per second, Hz.
        position: shape (T, M, 3), m, in the file's own axes; NaN where a point was not seen.
        up: the axis that the file says is up, "x", "y" or "z"; None if it does not say.
        source: the name of the file.
    """

    labels: tuple[str, ...]
    rate: float
    position: Array
    up: str | None
    source: str


def bridged(track: Array) -> Array:
    """A track (T, 3), seen at least once, with its gaps bridged by straight lines."""
    there = np.flatnonzero(~np.isnan(track[:, 0]))
    every = np.arange(len(track))
    return np.stack([np.interp(every, there, track[there, axis]) for axis in range(3)], axis=-1)
