"""Walk tuning: finds the settings with which a robot walks farthest without a fall, and stays away from that edge.

First the settings that shape a step are searched by small random changes, at a pace that grows as long as the robot
stands: share, longest and fastest times the pace. Then the edge is found by halving: the quickest pace at which the
robot stands in every trial. The settings that are kept go at EDGE of it, and are judged under pushes that nothing was
chosen by.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from sim.models.walk_settings import WalkSettings
from sim.physics.walk_trial import Course, Trial, walk_trial
from sim.robots.robot import Robot

EDGE = 0.85
"""The share of the quickest pace that is kept."""

# What changes with the pace, and what is searched, with the least and most that it may be.
PACE = ("share", "longest", "fastest")
SEARCHED = {
    "width": (0.15, 0.6),
    "bend": (0.02, 0.25),
    "lift": (0.05, 0.2),
    "double_support": (0.01, 0.15),
    "roll": (0.1, 0.95),
    "ahead": (0.5, 1.1),
    "aside": (0.3, 1.1),
    "ankle": (0.2, 1.2),
    "upright": (0.1, 1.0),
    "feed_forward": (0.0, 1.0),
}
# By how much settings are changed at first, and how that grows after a success and shrinks after a failure.
CHANGE, MORE, LESS = 0.15, 1.4, 0.9
# The pace grows by so much when it stood, and the edge is looked for up to so many times the pace.
QUICKER, FARTHEST, HALVINGS = 1.03, 1.3, 5
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


def tune_walk(
    robot: Robot,
    courses: Sequence[Course],
    impulse: float,
    rounds: int,
    told: Callable[[str], object],
    seed: int = 0,
) -> Tuned:
    """Tunes a robot on courses under pushes.

    Args:
        robot: its settings are what the search begins with.
        courses: each is walked in every round, with pushes of a seed of its own.
        impulse: of a push, N s.
        rounds: of the search.
        told: is told how it stands, after each of the rounds + HALVINGS + 1 steps.
        seed: of the search.
    """
    random, change, best = np.random.default_rng(seed), CHANGE, robot.walk
    score = _score(walk_courses(robot, best, courses, impulse), courses)
    for _ in range(rounds):
        new = changed(best, change, random)
        if score[0] == 1.0:
            new = paced(new, QUICKER)
        found = _score(walk_courses(robot, new, courses, impulse), courses)
        better = found > score
        change = min(change * (MORE if better else LESS), 2.0 * CHANGE)
        if better:
            best, score = new, found
        told(f"stands {score[0]:.0%}, {score[1]:.1f} m")
    return _kept(robot, best, courses, impulse, told)


def _kept(
    robot: Robot, settings: WalkSettings, courses: Sequence[Course], impulse: float, told: Callable[[str], object]
) -> Tuned:
    """The settings at EDGE of the quickest pace at which it stands."""
    low, high = 0.0, FARTHEST
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        stands = _score(walk_courses(robot, paced(settings, middle), courses, impulse), courses)[0] == 1.0
        low, high = (middle, high) if stands else (low, middle)
        told(f"edge at {low:.2f} to {high:.2f}")
    kept = paced(settings, EDGE * low) if low > 0.0 else settings
    trials = walk_courses(robot, kept, courses, impulse, FRESH)
    told("done")
    return Tuned(kept, low, tuple(trial.walked_m for trial in trials), _score(trials, courses)[0] == 1.0)


def walk_courses(
    robot: Robot, settings: WalkSettings, courses: Sequence[Course], impulse: float, first: int = 0
) -> list[Trial]:
    """Walks each course once with these settings, with pushes of a seed of its own, from the first on."""
    return [walk_trial(robot, course, impulse, seed, settings) for seed, course in enumerate(courses, first)]


def _score(trials: Sequence[Trial], courses: Sequence[Course]) -> tuple[float, float]:
    """The share of the time in which it stood, and how far it went, m: the more the better, in this order."""
    stood = sum(trial.stood_s for trial in trials) / sum(course.seconds for course in courses)
    return stood, sum(trial.walked_m for trial in trials)
