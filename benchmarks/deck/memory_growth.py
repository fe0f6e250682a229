"""How much memory is in use, and whether it grows: a rate with an interval, so that a leak can be told from a step.

Memory is taken from the system by steps of about a megabyte, so that what was seen at one time is mostly what was seen
just before. A line through all points would take that for certainty; the rates of separate stretches do not.
"""

from __future__ import annotations

import math
import resource
from pathlib import Path

import msgspec
import numpy as np

STRETCHES = 8
STUDENT = 2.365  # the 97.5th percentile of Student's t with STRETCHES - 1 degrees of freedom


class Growth(msgspec.Struct, frozen=True):
    """How fast something grows in an hour: the mean and its 95 % interval; 0 where it was not watched for long."""

    mean: float
    low: float
    high: float


def growth(points: list[tuple[float, float]]) -> Growth:
    """How fast something grows that was looked at over a time: (s, amount) at each look; the amount in an hour.

    The time is cut into STRETCHES stretches, and the interval is Student's for the mean of their rates. A line through
    all points would not do: memory grows by steps, so that neighbouring points say the same.
    """
    if len(points) <= STRETCHES:
        return Growth(0.0, 0.0, 0.0)
    ends = np.array(points)[np.linspace(0, len(points) - 1, STRETCHES + 1).astype(int)]
    time, amount = np.diff(ends, axis=0).T
    rates = 3600.0 * amount / time
    mean = 3600.0 * float(amount.sum() / time.sum())
    reach = STUDENT * float(rates.std(ddof=1)) / math.sqrt(STRETCHES)
    return Growth(mean, mean - reach, mean + reach)


def memory_kb() -> float:
    """The memory in use, kB."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1024.0
    except OSError:
        return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
