"""Trials of a motion: does it survive a free run, a start from noise, and disturbance?

The disturbances are the thesis's (`disturbance.py`). A trainer's choice (`failures`) needs more runs than a verdict
(`stress_test`): a motion that fails in one run of ten passes five runs more often than not.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from controller.learning.measures.disturbance import Kind, disturbed
from controller.learning.measures.self_test import Judge, MotionVerdict, after_disturbance, self_test
from controller.networks.base import AnyNetwork

RUNS: dict[Kind, int] = {"robustness": 8, "stability": 16}  # disturbed runs for a choice
FREE_RUN = sum(RUNS.values())  # weight of a failed free run, in disturbed runs
STRESS_RUNS = 5  # of each kind for a verdict
FORGIVEN = 1  # failures that a passing motion may have
_WORDS: dict[Kind, str] = {"robustness": "started from noise", "stability": "disturbed"}


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


def stress_test(
    network: AnyNetwork, verdicts: dict[str, MotionVerdict], judge: Judge, seed: int
) -> dict[str, MotionVerdict]:
    """The verdicts of `self_test`, failed for motions that do not survive a disturbance, with noise of a seed."""
    # One-shots of autonomous networks are not tested: after a disturbance they may be at any phase.
    knows_phase = network.as_phase_network is not None
    return {
        name: _stressed(network, name, verdict, judge, seed)
        if verdict.passed and (judge.loops[name] or knows_phase)
        else verdict
        for name, verdict in verdicts.items()
    }


def _stressed(network: AnyNetwork, motion: str, verdict: MotionVerdict, judge: Judge, seed: int) -> MotionVerdict:
    rng = np.random.default_rng([seed, network.motions.index(motion)])
    for kind, words in _WORDS.items():
        runs = disturbed(kind, network, motion, STRESS_RUNS, rng)
        failed = sum(not after_disturbance(network, judge, motion, run.astype(np.float64)).passed for run in runs)
        if failed > FORGIVEN:
            return replace(verdict, passed=False, reason=f"fails {failed} of {STRESS_RUNS} times when {words}")
    return verdict
