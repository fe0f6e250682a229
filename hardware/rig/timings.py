"""How long calls took: the latest durations, in a fixed array, so that a loop can keep them without allocating."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray


class Timings:
    """The latest `capacity` durations.

    Use it as a `with` block around what is to be timed.
    """

    __slots__ = ("_count", "_microseconds", "_since")

    def __init__(self, capacity: int = 4096) -> None:
        self._microseconds = np.zeros(capacity, dtype=np.float64)
        self._count = 0
        self._since = 0

    def __enter__(self) -> None:
        self._since = time.perf_counter_ns()

    def __exit__(self, *raised: object) -> None:
        self._microseconds[self._count % len(self._microseconds)] = (time.perf_counter_ns() - self._since) * 1e-3
        self._count += 1

    @property
    def microseconds(self) -> NDArray[np.float64]:
        """A copy of the durations kept, shape (up to capacity,), us, in no particular order."""
        return self._microseconds[: self._count].copy()

    @property
    def median(self) -> float:
        """The p50 of what is kept, us; 0 where nothing was timed yet."""
        return float(np.median(self.microseconds)) if self._count else 0.0
