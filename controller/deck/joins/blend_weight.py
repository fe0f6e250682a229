"""The weights of blended motions over time: along a quintic, as a switching module gives them, or in a crossing.

The duration of a crossing from one motion to another is the shortest within the limits of a join. Both motions go on
while their weights change, so a trial mixes what both do next, as `posture_blend` will. Which way round each bone goes
is chosen for all of the crossing: the one that is shorter on the whole. (Chosen at its beginning, it may turn out the
longer one, and a bone that has to go back the other way half through is fast.) From SHORTEST on the time grows until
the mixture is within bounds. Where it is not even with LONGEST, these motions cannot be mixed here.

As in the search for a fade there is one trial in TRIAL_EVERY seconds; until the time is found, nothing is mixed.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from math import ceil

import numpy as np

from controller.deck.joins.deck_motions import SUMMED
from controller.deck.joins.fade_search import LONGEST, SHORTEST, TRIAL_EVERY
from controller.deck.joins.join_limits import Bounds
from controller.deck.joins.posture_blend import smooth_headings, weighted_mean
from controller.motion.quintic import rise
from controller.motion.rotations import Array, continuous, multiply, rotate, yaw
from controller.motion.skeleton import Posture, Skeleton, walk_path
from controller.networks.centralized.centralized import Passage

# The longest time between two moments at which a mixture is computed, s, and the fewest of them.
_STEP, _FEWEST = 0.025, 16
_LONGER = 1.1  # by which factor the time grows at least


class CrossingSearch:
    """Finds the duration of a crossing, trial by trial, in which no joint exceeds the bounds.

    `ahead` gives both motions at times (S,) from the present trial on, s; the first is 0.
    """

    def __init__(self, ahead: Callable[[Array], tuple[Posture, Posture]], skeleton: Skeleton, bounds: Bounds) -> None:
        self.seconds: float | None = None  # the duration once found; None where none is within bounds
        self.found = False  # whether `seconds` has been found, or found to be None
        # The quaternions of both motions at its beginning, of each bone on the side from which it is mixed, from the
        # first trial on, shape (2, 1 + B, 4).
        self.sides: Array = np.empty(0)
        self._ahead, self._skeleton, self._bounds = ahead, skeleton, bounds
        self._candidate, self._trials, self._elapsed = SHORTEST, 0, 0.0

    def advance(self, dt: float) -> None:
        """Goes on by what falls into the next dt seconds."""
        self._elapsed += dt
        while not self.found and (self._trials + 1) * TRIAL_EVERY < self._elapsed + 1e-9:
            self._trials += 1
            beyond = self._beyond(self._candidate)
            if beyond <= 1.0:
                self.seconds = self._candidate
            self.found = beyond <= 1.0 or self._candidate >= LONGEST
            self._candidate = min(LONGEST, self._candidate * max(_LONGER, beyond**0.5))

    def _beyond(self, seconds: float) -> float:
        """The use of the bounds by a crossing of this duration; 1 is the limit, and an excess in speed is squared."""
        samples = max(_FEWEST, ceil(seconds / _STEP))
        step, share = seconds / samples, np.arange(samples + 1.0) / samples
        mixed, self.sides = crossed(*self._ahead(seconds * share), rise(share), step)
        pose = walk_path(mixed, step)
        places = self._skeleton.joints(pose.root_position, pose.rotation)
        moved = (places[1:] - places[:-1]) / step
        bent = (moved[1:] - moved[:-1]) / step
        speed, acceleration = (float((part * part).sum(-1).max()) ** 0.5 for part in (moved, bent))
        # What a crossing adds goes with 1 / T in speed and with 1 / T^2 in acceleration.
        return max(acceleration / self._bounds.acceleration, (speed / self._bounds.speed) ** 2)


def crossed(first: Posture, second: Posture, weight: Array, step: float) -> tuple[Posture, Array]:
    """The mixture of two motions (S, ...), `step` seconds apart, as the weight of the second (S,) changes.

    It is seen from the smooth heading of the two (`posture_blend`); also the `sides` it begins with.
    """
    weights = np.array([1.0 - weight, weight])
    headings = [smooth_headings(motion.turn_rate, step) for motion in (first, second)]
    offset, rate = np.array(headings).swapaxes(0, 1)
    forth = yaw(offset)
    # Moments first, as `continuous` wants it.
    turned = multiply(forth[:, :, None], np.array([first.rotation, second.rotation])).swapaxes(0, 1)
    points = continuous(turned).swapaxes(0, 1)
    apart = weight * (1.0 - weight) @ (points[0] * points[1]).sum(-1)
    points[1, :, apart < 0.0] *= -1.0
    velocity = np.zeros((2, len(weight), 3))
    velocity[..., :2] = first.velocity, second.velocity
    along = (weights[..., None] * rotate(forth, velocity)).sum(0)
    height = (weights * (first.height, second.height)).sum(0)
    mean = weighted_mean(points, weights[..., None])
    return Posture(height, along[:, :2], (weights * rate).sum(0), mean), points[:, 0]


class Weights(ABC):
    """The weights of motions that run side by side, on their way to their goals."""

    values: tuple[float, ...] = (1.0, 0.0)  # the present weights, which sum to 1
    changing = True  # whether they have not reached their goals
    fails = False  # whether they cannot change within the limits of a join

    @abstractmethod
    def advance(self, dt: float) -> tuple[float, ...]:
        """The weights dt seconds later."""


class Ramps(Weights):
    """Weights that change along quintics, all within the same time, s, from start to goal, each of which sums to 1."""

    def __init__(self, start: Sequence[float], goal: Sequence[float], seconds: float) -> None:
        self._ends, self._seconds = tuple(zip(start, goal, strict=True)), max(seconds, 1e-9)
        self._elapsed = 0.0
        self.advance(0.0)

    def advance(self, dt: float) -> tuple[float, ...]:
        """The weights dt seconds later."""
        self._elapsed += dt
        self.changing = self._elapsed < self._seconds - SUMMED
        share = rise(self._elapsed / self._seconds) if self.changing else 1.0
        self.values = tuple((1.0 - share) * start + share * goal for start, goal in self._ends)
        return self.values


class Crossing(Weights):
    """A take-over along a quintic once its duration is found, if it is; `begin` is called then, with the `sides`."""

    def __init__(self, search: CrossingSearch, begin: Callable[[Array], None]) -> None:
        self._search, self._begin = search, begin
        self._elapsed = 0.0

    def advance(self, dt: float) -> tuple[float, ...]:
        """The weights dt seconds later; the first motion has all until the duration is found."""
        search = self._search
        if search.seconds is None:
            search.advance(dt)
            if search.seconds is None:
                self.fails = search.found
                return self.values
            self._begin(search.sides)
        self._elapsed += dt
        weight = rise(min(1.0, self._elapsed / search.seconds))
        self.values, self.changing = (1.0 - weight, weight), self._elapsed < search.seconds
        return self.values


class ModuleTakeOver(Weights):
    """A take-over as a switching module goes from one motion to another (Vakulenko et al. 2017)."""

    def __init__(self, motions: int, source: int, target: int) -> None:
        self._passage = Passage(motions)
        self._passage.module.reset(source)
        self._passage.begin(target)
        self.values = 1.0 - self._passage.share, self._passage.share

    def advance(self, dt: float) -> tuple[float, ...]:
        """The weights dt seconds later."""
        self.changing = self.changing and self._passage.advance(dt)
        weight = self._passage.share if self.changing else 1.0
        self.values = 1.0 - weight, weight
        return self.values
