"""Walk tuning: finds the settings with which a robot walks farthest without a fall, and stays away from that edge.

First the settings that shape a step are searched by small random changes, several at a time, at a pace that grows as
long as the robot stands: share, longest and fastest times the pace. Then the edge is narrowed down: the quickest pace
at which the robot stands in every trial. The settings that are kept go at EDGE of it, and are judged under pushes that
nothing was chosen by.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from sim.models.walk_settings import WalkSettings
from sim.physics.walk_trial import Trial

EDGE = 0.85
"""The share of the quickest pace that is kept."""

# What changes with the pace, and what is searched, with the least and most that it may be.
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
# So many settings are tried at a time, whatever the number of processes: what is found does not depend on it.
TOGETHER = 4
# By how much settings are changed at first, and how that grows where one of them was better and shrinks where none was.
CHANGE, MORE, LESS = 0.15, 1.4, 0.75
# The pace grows by so much when it stood, and the edge is looked for up to so many times the pace, this often.
QUICKER, FARTHEST, NARROWED = 1.1, 1.3, 2
# From here on count the seeds of pushes that settings are judged by, and not chosen.
FRESH = 1000


@dataclass(frozen=True)
class Tuned:
    """What was found.

    Attributes:
        settings: that are kept.
        edge: the quickest pace at which it stood in every trial, relative to what the search found; 0 if it fell at
            every pace, and then the settings are not slowed down.
        walked: how far it went with the settings that are kept on each course, under pushes of seeds from FRESH on, m.
        stood: whether it stood on all of them.
    """

    settings: WalkSettings
    edge: float
    walked: tuple[float, ...]
    stood: bool


def paced(settings: WalkSettings, pace: float) -> WalkSettings:
    """The same settings for steps that are longer by a factor."""
    return msgspec.structs.replace(settings, **{name: pace * getattr(settings, name) for name in PACE})


def changed(settings: WalkSettings, change: float, random: np.random.Generator) -> WalkSettings:
    """Settings nearby: each one that is searched changes by about this share of itself."""
    new = {}
    for name, (least, most) in SEARCHED.items():
        factor = np.exp(change * random.standard_normal())
        new[name] = float(np.clip(getattr(settings, name) * factor, least, most))
    return msgspec.structs.replace(settings, **new)


Walks = Callable[[Sequence[WalkSettings], int], Sequence[Sequence[Trial]]]
"""Walks all courses with each of some settings, with pushes of a seed for each course, from a first seed on."""


def steps(rounds: int) -> int:
    """How often `tune_walk` says how it stands."""
    return -(-rounds // TOGETHER) + NARROWED + 1


def tune_walk(
    start: WalkSettings, walks: Walks, seconds: float, rounds: int, told: Callable[[str], object], seed: int = 0
) -> Tuned:
    """Tunes a robot on courses under pushes.

    Args:
        start: what the search begins with.
        walks: walks the courses.
        seconds: the length of all courses together.
        rounds: how many settings are tried.
        told: is told how it stands, after each of the `steps`.
        seed: of the search.
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
        told(f"stands {score[0]:.0%}, {score[1]:.1f} m")
    low, high = 0.0, FARTHEST
    for _ in range(NARROWED):
        paces = np.linspace(low, high, TOGETHER + 2)
        stands = [score[0] == 1.0 for score in scores([paced(best, float(pace)) for pace in paces[1:-1]])]
        slower = stands.index(False) if False in stands else TOGETHER
        low, high = float(paces[slower]), float(paces[slower + 1])
        told(f"edge at {low:.2f} to {high:.2f}")
    kept = paced(best, EDGE * low) if low > 0.0 else best
    trials = walks([kept], FRESH)[0]
    told("done")
    return Tuned(kept, low, tuple(trial.walked_m for trial in trials), _score(trials, seconds)[0] == 1.0)


def _score(trials: Sequence[Trial], seconds: float) -> tuple[float, float]:
    """The share of the time in which it stood, and how far it went, m: the more the better, in this order."""
    return sum(trial.stood_s for trial in trials) / seconds, sum(trial.walked_m for trial in trials)
