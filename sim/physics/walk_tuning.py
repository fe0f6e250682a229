"""Walk tuning: finds the settings with which a robot walks farthest without a fall, with a margin to that edge.

Random search over the settings of a step, at a pace (a factor of share, longest and fastest) that grows as long as the
robot stands; then bisection for the quickest pace at which it stands in every trial. The result walks at EDGE of that
pace and is judged under pushes that the search did not use.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from sim.models.robot_file import WalkSettings
from sim.physics.walk_trial import Trial

EDGE = 0.85  # share of the quickest pace in the result

# The settings that scale with the pace, and the searched ones with their bounds.
PACE = ("share", "longest", "fastest")
SEARCHED = {
    "slowest": (1.5, 3.5),
    "width": (0.15, 0.6),
    "bend": (0.02, 0.25),
    "lift": (0.05, 0.2),
    "double_support": (0.01, 0.15),
    "roll": (0.1, 0.95),
    "ahead": (0.5, 1.1),
    "aside": (0.3, 1.1),
    "ankle": (0.2, 1.2),
    "lean": (0.1, 0.8),
    "upright": (0.1, 1.0),
    "feed_forward": (0.0, 1.0),
    "toe": (0.05, 0.6),
    "heel": (0.02, 0.3),
}
TOGETHER = 4  # candidates a round, independent of the number of processes, so that the result is too
# First relative change of a setting, its growth after a success and its decay after none.
CHANGE, MORE, LESS = 0.15, 1.4, 0.75
# Growth of the pace while the robot stands; upper bound and rounds of the bisection.
QUICKER, FARTHEST, NARROWED = 1.1, 1.3, 2
FRESH = 1000  # first seed of the pushes that judge the result


@dataclass(frozen=True)
class Tuned:
    """Result of a tuning."""

    settings: WalkSettings
    # The quickest pace at which it stood in every trial, relative to the search's; 0 if it fell at every pace, and then
    # the settings are not slowed down.
    edge: float
    walked: tuple[float, ...]  # distance on each course, under pushes of seeds from FRESH on, m
    stood: bool  # whether it stood on all of them


def paced(settings: WalkSettings, pace: float) -> WalkSettings:
    """Settings at another pace."""
    return msgspec.structs.replace(settings, **{name: pace * getattr(settings, name) for name in PACE})


def changed(settings: WalkSettings, change: float, random: np.random.Generator) -> WalkSettings:
    """Settings nearby: each searched one changes by about this share of itself."""
    new = {}
    for name, ends in SEARCHED.items():
        new[name] = float(np.clip(getattr(settings, name) * np.exp(change * random.standard_normal()), *ends))
    return msgspec.structs.replace(settings, **new)


Walks = Callable[[Sequence[WalkSettings], int], Sequence[Sequence[Trial]]]
"""Trials of each of some settings on all courses; the seeds of the pushes count from a first one."""


def steps(rounds: int) -> int:
    """The number of progress reports of `tune_walk`."""
    return -(-rounds // TOGETHER) + NARROWED + 1


def tune_walk(
    start: WalkSettings, walks: Walks, seconds: float, rounds: int, progress: Callable[[str], object], seed: int = 0
) -> Tuned:
    """Tunes a robot on courses, of some seconds together, under pushes.

    `rounds` is the number of candidates; `progress` receives a line after each of the `steps`.
    """

    def scores(tried: Sequence[WalkSettings]) -> list[tuple[float, float]]:
        return [_score(trials, seconds) for trials in walks(tried, 0)]

    random, change, best = np.random.default_rng(seed), CHANGE, start
    score = scores([best])[0]
    for first in range(0, rounds, TOGETHER):
        tried = [changed(best, change, random) for _ in range(min(TOGETHER, rounds - first))]
        if score[0] == 1.0:
            tried = [paced(settings, QUICKER) for settings in tried]
        found = scores(tried)
        quickest = max(range(len(tried)), key=found.__getitem__)
        better = found[quickest] > score
        change = min(change * (MORE if better else LESS), 2.0 * CHANGE)
        if better:
            best, score = tried[quickest], found[quickest]
        progress(f"stands {score[0]:.0%}, {score[1]:.1f} m")
    low, high = 0.0, FARTHEST
    for _ in range(NARROWED):
        paces = np.linspace(low, high, TOGETHER + 2)
        stands = [score[0] == 1.0 for score in scores([paced(best, float(pace)) for pace in paces[1:-1]])]
        slower = stands.index(False) if False in stands else TOGETHER
        low, high = float(paces[slower]), float(paces[slower + 1])
        progress(f"edge at {low:.2f} to {high:.2f}")
    kept = paced(best, EDGE * low) if low > 0.0 else best
    trials = walks([kept], FRESH)[0]
    progress("done")
    return Tuned(kept, low, tuple(trial.walked_m for trial in trials), _score(trials, seconds)[0] == 1.0)


def _score(trials: Sequence[Trial], seconds: float) -> tuple[float, float]:
    """Share of the time standing, and distance, m: compared in this order."""
    return sum(trial.stood_s for trial in trials) / seconds, sum(trial.walked_m for trial in trials)
