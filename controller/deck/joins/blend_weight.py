"""The weights of blended motions over time: along a quintic, or as a switching module gives them."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

from controller.deck.joins.crossing_search import CrossingSearch
from controller.motion.quintic import rise
from controller.motion.rotations import Array
from controller.networks.centralized.centralized import Passage


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
        share = rise(min(1.0, self._elapsed / self._seconds))
        self.values = tuple((1.0 - share) * start + share * goal for start, goal in self._ends)
        self.changing = self._elapsed < self._seconds
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
