"""Confidence intervals of counted shares, of runs that are independent of each other and of runs that are not."""

import math
from collections.abc import Sequence

Z_95 = 1.959964


def wilson(failures: float, runs: float) -> tuple[float, float]:
    """The 95 % interval (Wilson 1927) of a rate with `failures` in `runs`; (0, 1) without any run."""
    # It stays within [0, 1] and does not shrink to nothing when nothing failed.
    if runs == 0:
        return 0.0, 1.0
    rate, square = failures / runs, Z_95**2
    middle = (rate + square / (2 * runs)) / (1 + square / runs)
    half = Z_95 / (1 + square / runs) * math.sqrt(rate * (1 - rate) / runs + square / (4 * runs**2))
    return 0.0 if failures == 0 else middle - half, 1.0 if failures == runs else middle + half


def grouped(failures: Sequence[int], runs: Sequence[int]) -> tuple[float, float]:
    """The 95 % interval of a rate over groups of runs that fail together, such as those of one motion of one network.

    Wilson's, with as many runs as would be worth so much if they were independent: their number over the design effect,
    the variance between groups relative to that of independent runs (Kish 1965; Korn and Graubard 1998). Where all runs
    end alike the groups cannot tell it, and each counts as one run.
    """
    groups, total = len(runs), sum(runs)
    if total == 0:
        return 0.0, 1.0
    rate = sum(failures) / total
    effect = total / groups
    if 0.0 < rate < 1.0 and groups > 1:
        between = sum((failed - rate * many) ** 2 for failed, many in zip(failures, runs, strict=True))
        effect = max(1.0, groups / (groups - 1) * between / (total * rate * (1.0 - rate)))
    worth = max(1.0, total / effect)
    return wilson(worth if rate == 1.0 else rate * worth, worth)
