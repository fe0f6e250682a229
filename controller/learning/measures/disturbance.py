"""Robustness and stability: does a motion survive a wrong start, or noise while it plays? (Deliallisi 2017, 4.1, 4.2)

- Robustness: x(0) = s + noise from U[-50, 50] on each neuron (eq. 4.1), then undisturbed.
- Stability: noise from N(0, 1) on each neuron in each of the first 250 steps (eqs 4.2, 4.4), then undisturbed.

Every run takes 1000 steps, all runs of a motion side by side; `self_test` judges whether each ended on that motion.
Intrinsic runs are the network alone; in guarded ones a guard (`controller/networks/guard.py`) restarts what is lost.
A trainer's choice (`failures`) needs more runs than a verdict (`stress_test`): a motion that fails in one run of ten
passes five runs more often than not.
"""

from dataclasses import replace
from typing import Literal

import numpy as np

from controller.learning.measures.self_test import Judge, MotionVerdict, after_disturbance, self_test
from controller.motion.rotations import Flags
from controller.networks.base import AnyNetwork, AutonomousNetwork, Float32
from controller.networks.guard import LossWatch

Kind = Literal["robustness", "stability"]

STEPS = 1000
START_NOISE = 50.0
NOISY_STEPS = 250
RUNS: dict[Kind, int] = {"robustness": 8, "stability": 16}  # disturbed runs for a choice
FREE_RUN = sum(RUNS.values())  # weight of a failed free run, in disturbed runs
STRESS_RUNS = 5  # of each kind for a verdict
FORGIVEN = 1  # failures that a passing motion may have
_WORDS: dict[Kind, str] = {"robustness": "started from noise", "stability": "disturbed"}


def disturbed(
    kind: Kind,
    network: AnyNetwork,
    motion: str,
    runs: int,
    rng: np.random.Generator,
    watch: LossWatch | None = None,
    weights: Float32 | None = None,
) -> Float32:
    """The frames, shape (R, STEPS, C), of R disturbed runs of a motion, each from its first anchor on.

    The network's own state is left alone.

    Args:
        watch: for guarded runs of a network that runs by itself: a new one, of the first anchor's frame in each run.
        weights: W of a conceptor network, shape (N, N), of which it keeps only k directions; without it only the part
            of a displacement counts that lies in them.
    """
    player, size = network.twin(runs), network.noise_size(motion)
    player.cue(motion, 0)
    if kind == "robustness":
        player.displace(rng.uniform(-START_NOISE, START_NOISE, (runs, size)).astype(np.float32), weights)
    lost = player.as_autonomous
    frames = np.empty((runs, player.channels))
    out = np.empty((runs, STEPS, player.channels), dtype=np.float32)
    noisy = NOISY_STEPS if kind == "stability" else 0
    with np.errstate(all="ignore"):  # a network that diverges is a result
        for step in range(STEPS):
            if watch is not None and lost is not None:
                _restart(lost, motion, watch, lost.astray())
            player.advance(frames, rng.standard_normal((runs, size), dtype=np.float32) if step < noisy else None)
            if watch is not None and lost is not None:
                _restart(lost, motion, watch, watch.inspect(frames, lost.astray()))
            out[:, step] = frames
    return out


def _restart(network: AutonomousNetwork, motion: str, watch: LossWatch, lost: Flags) -> None:
    rows = np.flatnonzero(lost)
    if len(rows):
        network.cue(motion, watch.restart(rows), rows)


def with_trials(verdicts: dict[str, MotionVerdict], failed: dict[str, int]) -> dict[str, MotionVerdict]:
    """The verdicts of free runs, failed too where more than FORGIVEN disturbed runs of a motion failed."""
    return verdicts | {
        name: replace(one, passed=False, reason=f"fails {failed[name]} times when disturbed")
        for name, one in verdicts.items()
        if one.passed and failed[name] > FORGIVEN
    }


def failures(
    network: AnyNetwork, motion: str, kinds: tuple[Kind, ...], judge: Judge, seed: int, weights: Float32 | None = None
) -> int:
    """The number of failed runs of a motion under kinds of disturbance, or FREE_RUN; `weights` as of `disturbed`."""
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
    found = dict(verdicts)
    for motion in [name for name, one in verdicts.items() if one.passed and (judge.loops[name] or knows_phase)]:
        rng = np.random.default_rng([seed, network.motions.index(motion)])
        for kind, words in _WORDS.items():
            runs = disturbed(kind, network, motion, STRESS_RUNS, rng)
            failed = sum(not after_disturbance(network, judge, motion, run.astype(np.float64)).passed for run in runs)
            if failed > FORGIVEN:
                reason = f"fails {failed} of {STRESS_RUNS} times when {words}"
                found[motion] = replace(verdicts[motion], passed=False, reason=reason)
                break
    return found
