"""Fault counts and call durations of a rig: a fault in the loop is a number here, never an exception."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import msgspec
import numpy as np
from numpy.typing import NDArray

Counts = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class RigFaults:
    """Counts since the rig was switched on, each of shape (J,)."""

    missed: Counts  # replies that did not come
    corrupt: Counts  # replies with a bad checksum
    alert: Counts  # replies in which the servo reported a hardware problem
    clipped: Counts  # targets beyond a limit of the rig file; the goal stays at the limit
    refused: Counts  # targets that were NaN or infinite; the joint kept its last goal
    unsent: Counts  # targets that the port did not take, or that came while the rig was stopped or recovering

    @classmethod
    def none(cls, joints: int) -> Self:
        """No faults yet."""
        return cls(*(np.zeros(joints, dtype=np.int64) for _ in fields(cls)))

    @property
    def total(self) -> int:
        """The sum of all but `clipped`, which the caller causes and not the rig."""
        return sum(int(counts.sum()) for kind, counts in self._kinds() if kind != "clipped")

    def by_joint(self, names: Sequence[str]) -> dict[str, dict[str, int]]:
        """The counts that are not zero: joint name, then kind, then count."""
        found: dict[str, dict[str, int]] = {}
        for kind, counts in self._kinds():
            for index in np.flatnonzero(counts).tolist():
                found.setdefault(names[index], {})[kind] = int(counts[index])
        return found

    def _kinds(self) -> list[tuple[str, Counts]]:
        return [(field.name, getattr(self, field.name)) for field in fields(self)]


class Timings:
    """The latest `capacity` durations of a `with` block, in a fixed array."""

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
        """A copy of the durations, shape (up to capacity,), us, in no particular order."""
        return self._microseconds[: self._count].copy()

    @property
    def percentiles(self) -> dict[str, float] | None:
        """p50, p99, p999 and max of the durations, us; None before the first."""
        durations = self.microseconds
        if not len(durations):
            return None
        p50, p99, p999 = np.percentile(durations, (50.0, 99.0, 99.9))
        return {"p50": float(p50), "p99": float(p99), "p999": float(p999), "max": float(durations.max())}


class RigReport(msgspec.Struct, frozen=True):
    """The counts and durations of a rig since it was switched on."""

    write_us: dict[str, float] | None  # `Timings.percentiles` of sending goals
    read_us: dict[str, float] | None  # `Timings.percentiles` of collecting states
    recoveries: int  # how often something was recovered
    faults: int  # `RigFaults.total`
    by_joint: dict[str, dict[str, int]]  # `RigFaults.by_joint`
