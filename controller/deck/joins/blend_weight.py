"""The weights of blended motions over time: along a quintic, or as a switching module gives them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from controller.deck.joins.crossing_search import CrossingSearch
from controller.motion.quintic import rise
from controller.motion.rotations import Array
from controller.networks.centralized.centralized import Passage


class Weights(Protocol):
    """The weights of motions that run side by side; they change until they have reached their goals."""

    @property
    def values(self) -> tuple[float, ...]:
        """The present weights, which sum to 1."""
        ...

    @property
    def changing(self) -> bool:
        """Whether they are still on their way."""
        ...

    def advance(self, dt: float) -> tuple[float, ...]:
        """The weights dt seconds later."""
        ...


class Weight(Protocol):
    """A weight in [0, 1] that changes until it has reached its goal."""

    @property
    def value(self) -> float:
        """The present weight."""
        ...

    @property
    def changing(self) -> bool:
        """Whether it is still on its way."""
        ...

    def advance(self, dt: float) -> float:
        """The weight dt seconds later."""
        ...


class Ramp:
    """A weight that rises or falls smoothly within some seconds.

    Args:
        start, goal: the weights at both ends.
        seconds: how long it takes.
    """

    def __init__(self, start: float, goal: float, seconds: float) -> None:
        self._start, self._goal, self._seconds = start, goal, max(seconds, 1e-9)
        self._elapsed = 0.0

    @property
    def value(self) -> float:
        """The present weight."""
        share = rise(min(1.0, self._elapsed / self._seconds))
        return (1.0 - share) * self._start + share * self._goal

    @property
    def changing(self) -> bool:
        """Whether it is still on its way."""
        return self._elapsed < self._seconds

    def advance(self, dt: float) -> float:
        """The weight dt seconds later."""
        self._elapsed += dt
        return self.value


class Ramps:
    """Weights that rise or fall smoothly, all within the same seconds.

    Args:
        start, goal: the weights at both ends, as many; each sums to 1.
        seconds: how long it takes.
    """

    def __init__(self, start: Sequence[float], goal: Sequence[float], seconds: float) -> None:
        self._ramps = [Ramp(*ends, seconds) for ends in zip(start, goal, strict=True)]

    @property
    def values(self) -> tuple[float, ...]:
        """The present weights."""
        return tuple(ramp.value for ramp in self._ramps)

    @property
    def changing(self) -> bool:
        """Whether they are still on their way."""
        return self._ramps[0].changing

    def advance(self, dt: float) -> tuple[float, ...]:
        """The weights dt seconds later."""
        return tuple(ramp.advance(dt) for ramp in self._ramps)


class TakeOver:
    """The weights of two motions of which the second takes over.

    Args:
        weight: of the second.
    """

    def __init__(self, weight: Weight) -> None:
        self._weight = weight

    @property
    def values(self) -> tuple[float, ...]:
        """The present weights."""
        return 1.0 - self._weight.value, self._weight.value

    @property
    def changing(self) -> bool:
        """Whether they are still on their way."""
        return self._weight.changing

    def advance(self, dt: float) -> tuple[float, ...]:
        """The weights dt seconds later."""
        self._weight.advance(dt)
        return self.values


class Crossing:
    """A weight that rises from 0 to 1, once it has been found how long that takes; where it may not, it stays 0.

    Args:
        search: finds how long it takes.
        begin: called when it begins, with the `sides` that were found.
    """

    def __init__(self, search: CrossingSearch, begin: Callable[[Array], None]) -> None:
        self._search, self._begin = search, begin
        self._ramp: Ramp | None = None

    @property
    def fails(self) -> bool:
        """Whether the motions are not to be mixed."""
        return self._search.found and self._search.seconds is None

    @property
    def value(self) -> float:
        """The present weight."""
        return self._ramp.value if self._ramp is not None else 0.0

    @property
    def changing(self) -> bool:
        """Whether it is still on its way."""
        return self._ramp is None or self._ramp.changing

    def advance(self, dt: float) -> float:
        """The weight dt seconds later."""
        if self._ramp is None:
            self._search.advance(dt)
            if self._search.seconds is None:
                return 0.0
            self._begin(self._search.sides)
            self._ramp = Ramp(0.0, 1.0, self._search.seconds)
        return self._ramp.advance(dt)


class ModuleWeight:
    """The weight that a switching module gives on its way to a motion (Vakulenko et al. 2017)."""

    def __init__(self, motions: int, source: int, target: int) -> None:
        self._passage = Passage(motions)
        self._passage.module.reset(source)
        self._passage.begin(target)
        self.changing = True

    @property
    def value(self) -> float:
        """The present weight."""
        return self._passage.share if self.changing else 1.0

    def advance(self, dt: float) -> float:
        """The weight dt seconds later."""
        self.changing = self.changing and self._passage.advance(dt)
        return self.value
