"""Trials of one motion, by which a trainer chooses: does it survive a free run, a start from noise, and disturbance?

The disturbances are the thesis's (`disturbance.py`). Choosing needs more runs than a verdict does: a motion
that fails in one run of ten passes five runs more often than not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from controller.learning.measures.disturbance import Kind, disturbed
from controller.learning.measures.self_test import Judge, MotionVerdict, self_test
from controller.networks.base import AnyNetwork

RUNS: dict[Kind, int] = {"robustness": 8, "stability": 16}
"""The number of disturbed runs of each kind."""

FREE_RUN = sum(RUNS.values())
"""The weight of a failed free run, in disturbed runs."""

FORGIVEN = 1
"""The number of failures that a passing motion may have."""


def with_trials(verdicts: dict[str, MotionVerdict], failed: dict[str, int]) -> dict[str, MotionVerdict]:
    """The verdicts of free runs, failed too where more than FORGIVEN disturbed runs of a motion failed."""
    return {
        name: replace(verdict, passed=False, reason=f"fails {failed[name]} times when disturbed")
        if verdict.passed and failed[name] > FORGIVEN
        else verdict
        for name, verdict in verdicts.items()
    }


def failures(
    network: AnyNetwork,
    motion: str,
    kinds: tuple[Kind, ...],
    judge: Judge,
    seed: int,
    weights: NDArray[np.float32] | None = None,
) -> int:
    """The number of failed runs of a motion under kinds of disturbance; if the free run fails, no other is tried.

    `weights` are W of a conceptor network, as for `disturbed`.
    """
    if not self_test(network, judge, (motion,))[motion].passed:
        return FREE_RUN
    failed = 0
    for kind in kinds:
        runs = RUNS[kind]
        rng = np.random.default_rng([seed, *motion.encode(), kind == "stability"])
        played = disturbed(kind, network, motion, runs, rng, weights=weights)
        failed += sum(not judge(motion, run.astype(np.float64)).passed for run in played)
    return failed
