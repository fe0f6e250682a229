"""Marker trajectories of a recording."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array

UNITS = {"mm": 0.001, "cm": 0.01, "dm": 0.1, "m": 1.0, "in": 0.0254, "inch": 0.0254, "inches": 0.0254, "ft": 0.3048}
"""Names of units in marker files, m."""
TALL = 1.6  # m: from the lowest to the highest point on a standing person
FARTHEST = 1e4  # m: a point beyond is a broken number


@dataclass(frozen=True, eq=False)
class Markers:
    """T frames of M points."""

    labels: tuple[str, ...]
    rate: float  # Hz
    position: Array  # (T, M, 3), m, in the axes of the file; NaN where a point was not seen
    up: str | None  # vertical axis of the file, "x", "y" or "z"; None if unknown
    source: str  # name of the file


def unit_of_size(position: Array) -> float:
    """The unit, m, mm or cm, in which points (T, M, 3), NaN where not seen, have the size of a person."""
    # Judged by the median frame; millimetres if no two points were seen.
    there = np.isfinite(position)
    highest = np.where(there, position, -np.inf).max(axis=1)
    lowest = np.where(there, position, np.inf).min(axis=1)
    size = (highest - lowest).max(axis=-1)
    size = size[np.isfinite(size) & (size > 0.0)]
    if len(size) == 0:
        return UNITS["mm"]
    return min((UNITS[unit] for unit in ("mm", "cm", "m")), key=lambda unit: abs(np.log(np.median(size) * unit / TALL)))


def bridged(track: Array) -> Array:
    """A track (T, C), seen at least once, with its gaps interpolated linearly."""
    there = np.flatnonzero(~np.isnan(track[:, 0]))
    every = np.arange(len(track))
    return np.stack([np.interp(every, there, track[there, axis]) for axis in range(track.shape[1])], axis=-1)


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """The runs (first, end) of set flags (K,)."""
    change = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(first), int(end)) for first, end in change.reshape(-1, 2)]
