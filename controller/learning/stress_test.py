"""The second part of the self-test: a motion must return from a noisy start and from disturbances.

Both disturbances are the thesis's (`disturbance.py`). One-shots of autonomous networks are not tested: after a
disturbance they may be at any phase. Centers keep the phase.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from controller.learning.measures.disturbance import Kind, disturbed
from controller.learning.measures.self_test import Judge, MotionVerdict, after_disturbance
from controller.networks.base import AnyNetwork

RUNS = 5
FORGIVEN = 1

_WORDS: dict[Kind, str] = {"robustness": "started from noise", "stability": "disturbed"}


def stress_test(
    network: AnyNetwork, verdicts: dict[str, MotionVerdict], judge: Judge, seed: int
) -> dict[str, MotionVerdict]:
    """The verdicts of `self_test`, failed for motions that do not survive a disturbance, with noise of a seed."""
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
        runs = disturbed(kind, network, motion, RUNS, rng)
        failed = sum(not after_disturbance(network, judge, motion, run.astype(np.float64)).passed for run in runs)
        if failed > FORGIVEN:
            return replace(verdict, passed=False, reason=f"fails {failed} of {RUNS} times when {words}")
    return verdict
