"""The confidence interval of a counted share."""

from __future__ import annotations

import math

Z_95 = 1.959964


def wilson(failures: int, runs: int) -> tuple[float, float]:
    """The 95 % interval (Wilson 1927) of a rate with `failures` in `runs`; (0, 1) without any run.

    It stays within [0, 1] and does not shrink to nothing when nothing failed.
    """
    if runs == 0:
        return 0.0, 1.0
    rate, square = failures / runs, Z_95**2
    middle = (rate + square / (2 * runs)) / (1 + square / runs)
    half = Z_95 / (1 + square / runs) * math.sqrt(rate * (1 - rate) / runs + square / (4 * runs**2))
    return 0.0 if failures == 0 else middle - half, 1.0 if failures == runs else middle + half
