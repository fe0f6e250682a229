"""Failure rates of a whole library over seeds and runs, spread over the cores, and their confidence intervals."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from joblib import delayed
from threadpoolctl import threadpool_limits

from controller.learning.fit import TrainedNetwork, first_to_pass, settle
from controller.learning.measures.disturbance import Kind, disturbed
from controller.learning.measures.self_test import Judge, after_disturbance
from controller.learning.recipe import LibraryRecipe
from controller.learning.training_set import TrainingSet
from controller.networks import guard
from motiondeck_base.jobs import ALONE, Jobs, spread

Tick = Callable[[], None]

# The most networks that are drawn until one passes the self-test, and the distance of their seeds.
ATTEMPTS = 4
SEEDS_APART = 10_000
Z_95 = 1.959964  # of a normal distribution, for an interval of 95 %


@dataclass(frozen=True)
class Count:
    """The failures of one motion of one network."""

    motion: str
    loop: bool
    seed: int
    drawn: int  # seed of the network, later than `seed` if an earlier one failed the self-test
    runs: int
    intrinsic: int  # failures without a guard
    guarded: int | None  # failures with one; None if it was not asked for, or the network needs none
    reason: str  # of the first intrinsic failure, or ""


def sweep(
    kind: Kind,
    networks: list[TrainedNetwork],
    syllabus: TrainingSet,
    runs: int,
    *,
    motions: list[str] | None = None,
    guarded: bool = True,
    jobs: Jobs = ALONE,
    tick: Tick = lambda: None,
) -> list[Count]:
    """Disturbs every motion of every network, without a guard and with one where the deck plays it with one.

    One count for each, in their order, after which `tick` is called. `syllabus` has the frames that the networks
    learned, to judge by.
    """
    judge = syllabus.judge
    tasks = (
        delayed(_count)(kind, trained, motion, runs, judge, len(syllabus.frames[motion]), guarded)
        for trained in networks
        for motion in motions or syllabus.frames
    )
    return gathered(tasks, jobs, tick)


def gathered(tasks: Iterable[Any], jobs: Jobs, tick: Tick) -> list[Any]:
    """The results of tasks, in their order; `tick` is called after each."""
    results = []
    for result in spread(tasks, jobs):
        results.append(result)
        tick()
    return results


def train_network(recipe: LibraryRecipe, syllabus: TrainingSet, seed: int) -> TrainedNetwork:
    """Trains a network; as in `fit`, other seeds are tried if a motion fails its self-test, but not `as_recorded`."""
    lessons, judge = syllabus.lessons(), syllabus.judge
    seeds = [seed + SEEDS_APART * attempt for attempt in range(1 if recipe.as_recorded else ATTEMPTS)]
    with threadpool_limits(1):
        taught = first_to_pass(seeds, lambda drawn: settle(recipe.network, lessons, drawn, judge))
    return replace(taught, asked=seed)


def _count(kind: Kind, one: TrainedNetwork, motion: str, runs: int, judge: Judge, length: int, guarded: bool) -> Count:
    network, loop = one.network, judge.loops[motion]
    watches: list[guard.LossWatch | None] = [None]
    if guarded and network.as_autonomous is not None:
        scale = guard.spread(network)
        beat = guard.beat(network, motion, scale, length, judge.rate, loop=loop)
        watches.append(guard.LossWatch(beat, scale, np.repeat(network.anchors(motion)[:1], runs, axis=0)))
    failed: list[int] = []
    reason = ""
    with threadpool_limits(1):
        for watch in watches:
            # The same noise for both; only the guard differs.
            rng = np.random.default_rng([one.asked, network.motions.index(motion), kind == "stability"])
            played = disturbed(kind, network, motion, runs, rng, watch, one.weights)
            verdicts = [after_disturbance(network, judge, motion, run.astype(np.float64)) for run in played]
            failed.append(sum(not verdict.passed for verdict in verdicts))
            reason = reason or next((verdict.reason for verdict in verdicts if not verdict.passed), "")
    intrinsic, with_guard = failed[0], failed[1] if len(failed) > 1 else None
    return Count(motion, loop, one.asked, one.seed, runs, intrinsic, with_guard, reason)


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
