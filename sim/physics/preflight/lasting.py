"""How long something lasts: what goes by at once does a robot no harm."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array

TICK = 0.005  # s
BRIEFLY = 0.05  # s


def lasting(off: Array, dt: float = TICK) -> Array:
    """The largest value that each column of (T, J) exceeds for a whole BRIEFLY, shape (J,)."""
    window = min(len(off), max(1, round(BRIEFLY / dt)))
    return np.lib.stride_tricks.sliding_window_view(off, window, axis=0).min(axis=-1).max(axis=0)


def lasting_until(off: Iterable[Array], until: float) -> Array:
    """The same of rows (J,), a tick each; it looks no further when a column has been above `until` for so long."""
    rows: list[Array] = []
    long = np.zeros(1, dtype=np.int64)
    for row in off:
        rows.append(row)
        long = np.where(row > until, long + 1, 0)
        if long.max() >= round(BRIEFLY / TICK):
            break
    return lasting(np.array(rows))


def longest(flags: NDArray[np.bool_]) -> int:
    """The length of the longest run of set samples."""
    most = run = 0
    for flag in flags:
        run = run + 1 if flag else 0
        most = max(most, run)
    return most
