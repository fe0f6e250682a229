"""Alignment in time: dynamic time warping and local alignment (Smith-Waterman), many pairs at once.

Both fill a table in which a cell needs its left, upper and upper-left neighbours. All cells of an antidiagonal are
independent of each other, so a table of n x m cells takes n + m steps of numpy, for a whole batch of tables.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.distance import cdist

from controller.motion.rotations import Array

# What a cell makes of its own value and its neighbours: (value, upper, left, upper-left) -> cell.
Step = Callable[[Array, Array, Array, Array], Array]


def fill(values: Array, step: Step, outside: float) -> Array:
    """Fills tables of shape (B, n, m); `outside` stands beyond their upper and left border."""
    batch, rows, columns = values.shape
    table = np.full((batch, rows + 1, columns + 1), outside)
    for diagonal in range(rows + columns - 1):
        i = np.arange(max(0, diagonal - columns + 1), min(rows, diagonal + 1))
        j = diagonal - i
        upper, left, corner = table[:, i, j + 1], table[:, i + 1, j], table[:, i, j]
        table[:, i + 1, j + 1] = step(values[:, i, j], upper, left, corner)
    return table[:, 1:, 1:]


def warped(cost: Array) -> Array:
    """The cost of the cheapest warping path to each cell of cost tables (B, n, m), each cell paid once."""

    def step(value: Array, upper: Array, left: Array, corner: Array) -> Array:
        before = np.minimum(np.minimum(upper, left), corner)
        return value + np.where(np.isinf(before), 0.0, before)

    return fill(cost, step, np.inf)


def warping_path(table: Array) -> list[tuple[int, int]]:
    """The cheapest path through one table (n, m) of `warped`, from (0, 0) to its last cell."""
    i, j = table.shape[0] - 1, table.shape[1] - 1
    path = [(i, j)]
    while i or j:
        steps = [(i - 1, j - 1), (i - 1, j), (i, j - 1)]
        i, j = min((cell for cell in steps if min(cell) >= 0), key=lambda cell: table[cell])
        path.append((i, j))
    return path[::-1]


def locally_aligned(similarity: Array, gap: float) -> Array:
    """The best local alignment ending in each cell of similarity tables (B, n, m), whose gaps cost `gap` each."""

    def step(value: Array, upper: Array, left: Array, corner: Array) -> Array:
        return np.maximum(np.maximum(corner + value, np.maximum(upper, left) - gap), 0.0)

    return fill(similarity, step, 0.0)


def padded(signals: list[Array]) -> Array:
    """Signals (T_j, C) in one array (B, longest, C), the short ones filled up with their last frame."""
    longest = max(len(signal) for signal in signals)
    return np.stack([np.pad(signal, ((0, longest - len(signal)), (0, 0)), mode="edge") for signal in signals])


def warping_distances(signal: Array, others: list[Array]) -> Array:
    """The dynamic time warping distance of a signal (n, C) to others (m_j, C), a frame of the longer one, shape (B,).

    Frames differ by their Euclidean distance.
    """
    batch = padded(others)
    cost = cdist(signal, batch.reshape(-1, batch.shape[2])).reshape(len(signal), *batch.shape[:2])
    table = warped(np.ascontiguousarray(cost.transpose(1, 0, 2), dtype=np.float64))
    lengths = np.array([len(other) for other in others])
    return table[np.arange(len(others)), -1, lengths - 1] / np.maximum(lengths, len(signal))


def aligned(base: Array, frames: int) -> Array:
    """Channels (T, C) stretched or squeezed to a number of frames: alignment in time, begin to begin and end to end."""
    if len(base) < 2:
        return np.repeat(base, frames, axis=0)
    place = np.linspace(0.0, len(base) - 1.0, frames)
    low = np.minimum(place.astype(np.int64), len(base) - 2)
    share = (place - low)[:, None]
    return (1.0 - share) * base[low] + share * base[low + 1]
