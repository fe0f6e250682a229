"""The weights of blended motions over time: along a quintic, or as a switching module gives them."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

from controller.deck.joins.crossing_search import CrossingSearch
from controller.motion.quintic import rise
from controller.motion.rotations import Array
from controller.networks.centralized.centralized import Passage


class Weights(ABC):
    """The weights of motions that run side by side, on their way to their goals."""

    @property
    @abstractmethod
    def values(self) -> tuple[float, ...]:
        """The present weights, which sum to 1."""

    @property
    @abstractmethod
    def changing(self) -> bool:
        """Whether they have not reached their goals."""

    @abstractmethod
    def _advance(self, dt: float) -> None: ...

    def advance(self, dt: float) -> tuple[float, ...]:
        """The weights dt seconds later."""
        self._advance(dt)
        return self.values


class Ramps(Weights):
    """Weights that change along quintics, all within the same time, s, from start to goal, each of which sums to 1."""

    def __init__(self, start: Sequence[float], goal: Sequence[float], seconds: float) -> None:
        self._ends, self._seconds = tuple(zip(start, goal, strict=True)), max(seconds, 1e-9)
        self._elapsed = 0.0

    @property
    def values(self) -> tuple[float, ...]:
        """The present weights."""
        share = rise(min(1.0, self._elapsed / self._seconds))
        return tuple((1.0 - share) * start + share * goal for start, goal in self._ends)

    @property
    def changing(self) -> bool:
        """Whether they have not reached their goals."""
        return self._elapsed < self._seconds

    def _advance(self, dt: float) -> None:
        self._elapsed += dt


class Crossing(Weights):
    """A take-over along a quintic once its duration is found, if it is; `begin` is called then, with the `sides`."""

    def __init__(self, search: CrossingSearch, begin: Callable[[Array], None]) -> None:
        self._search, self._begin = search, begin
        self._elapsed = 0.0

    @property
    def fails(self) -> bool:
        """Whether no duration is within the limits."""
        return self._search.found and self._search.seconds is None

    @property
    def values(self) -> tuple[float, ...]:
        """The present weights of both motions."""
        seconds = self._search.seconds
        weight = rise(min(1.0, self._elapsed / seconds)) if seconds is not None else 0.0
        return 1.0 - weight, weight

    @property
    def changing(self) -> bool:
        """Whether the second motion has not taken over."""
        return self._search.seconds is None or self._elapsed < self._search.seconds

    def _advance(self, dt: float) -> None:
        if self._search.seconds is None:
            self._search.advance(dt)
            if self._search.seconds is None:
                return
            self._begin(self._search.sides)
        self._elapsed += dt


class ModuleTakeOver(Weights):
    """A take-over as a switching module goes from one motion to another (Vakulenko et al. 2017)."""

    def __init__(self, motions: int, source: int, target: int) -> None:
        self._passage = Passage(motions)
        self._passage.module.reset(source)
        self._passage.begin(target)
        self._changing = True

    @property
    def values(self) -> tuple[float, ...]:
        """The present weights of both motions."""
        weight = self._passage.share if self._changing else 1.0
        return 1.0 - weight, weight

    @property
    def changing(self) -> bool:
        """Whether the second motion has not taken over."""
        return self._changing

    def _advance(self, dt: float) -> None:
        self._changing = self._changing and self._passage.advance(dt)
