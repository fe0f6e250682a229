"""Base classes of reservoir networks, and of those that run by themselves."""

from abc import abstractmethod
from typing import Any, Generic, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from controller.networks.base import AutonomousNetwork, Morph, Motion, Network, Rows
from motiondeck_base.errors import MotiondeckError

Float32 = NDArray[np.float32]


class ReservoirNetwork(Network[Motion]):
    """N neurons and the motions that they have learned."""

    activation: Float32

    def __init__(self, motions: dict[str, Motion], neurons: int, channels: int, runs: tuple[int, ...] = ()) -> None:
        super().__init__(motions)
        self.neurons, self.channels, self.runs = neurons, channels, runs
        self.activation = np.zeros((*runs, neurons), dtype=np.float32)
        self._frame = np.zeros((*runs, channels), dtype=np.float32)

    @abstractmethod
    def with_motions(self, more: dict[str, Motion], runs: int | None = None) -> Self:
        """The same reservoir with further motions, of one run or of several."""

    def twin(self, runs: int | None = None) -> Self:
        return self.with_motions({}, runs)

    def noise_size(self, motion: str) -> int:
        return self.neurons


class AutonomousReservoir(ReservoirNetwork[Motion]):
    """A reservoir that runs by itself; fits `base.AutonomousNetwork`."""

    @property
    def as_autonomous(self) -> AutonomousNetwork:
        return self

    @abstractmethod
    def astray(self) -> Any:
        """Whether the state is one that undisturbed playing never reaches; of several runs, shape (R,)."""

    @abstractmethod
    def cue(self, motion: str, anchor: Any, rows: Rows = ...) -> None:
        """Puts the network into the stored state of an anchor; of several runs, some of them, one anchor each."""

    @abstractmethod
    def morph(self, source: str, target: str) -> Morph:
        """A morph that starts where the network is in the source (Deliallisi 2017, eqs 3.7, 3.16 and 3.17).

        mu = 0 is the source, mu = 1 the target; between them lies interpolation, beyond them extrapolation.
        """


class StatesMotion(Protocol):
    """A motion with states z at its anchors."""

    @property
    def states(self) -> Float32:
        """Shape (A, k)."""
        ...


States = TypeVar("States", bound=StatesMotion)


class DirectionReservoir(AutonomousReservoir[States]):
    """A reservoir whose motions play in k directions each: its state is z, shape (*runs, k)."""

    def __init__(self, motions: dict[str, States], neurons: int, channels: int, runs: tuple[int, ...] = ()) -> None:
        super().__init__(motions, neurons, channels, runs)
        # Twice the length of the longest stored state, squared: undisturbed playing stays below it.
        self._reach = {name: 4.0 * float(np.square(part.states).sum(1).max()) for name, part in motions.items()}

    def cue(self, motion: str, anchor: Any, rows: Rows = ...) -> None:
        part = self[motion]
        if rows is ...:
            self.start(part, self._reach[motion], part.states[anchor])
        else:
            self._z[rows] = part.states[anchor]

    def start(self, part: States, bound: float, state: Float32) -> None:
        """Plays a motion from a state on, which counts as astray where |z|^2 is above a bound."""
        self._playing, self._bound = part, bound
        self._z = np.broadcast_to(state, (*self.runs, state.shape[-1])).copy()

    def astray(self) -> Any:
        """Whether |z| is larger than in undisturbed playing, or NaN; of several runs, shape (R,)."""
        z = self._z
        return ~((np.dot(z, z) if z.ndim == 1 else np.square(z).sum(1)) <= self._bound)

    def snapshot(self) -> tuple[States, float, Float32]:
        return self._playing, self._bound, self._z.copy()

    def restore(self, snapshot: Any) -> None:
        self.start(*snapshot)


class DirectionMorph(Generic[States]):
    """The states of source and target of a morph; MotiondeckError if the network does not play the source."""

    def __init__(self, network: DirectionReservoir[States], source: str, target: str) -> None:
        self._reservoir, self._to = network, target
        self._source, self._target = network[source], network[target]
        playing, self._bound, self._z_source = network.snapshot()
        require_playing(playing is self._source, source)
        self._z_target = np.zeros(self._target.states.shape[1], dtype=np.float32)

    def settle(self) -> None:
        """Leaves the target playing; what lies outside of its directions is dropped, as at mu = 1."""
        self._reservoir.cue(self._to, 0)
        playing, bound, _ = self._reservoir.snapshot()
        self._reservoir.restore((playing, bound, self._z_target.astype(np.float32)))

    def give_up(self) -> None:
        """Leaves the source playing."""
        self._reservoir.restore((self._source, self._bound, self._z_source.astype(np.float32)))


def require_playing(plays: bool, source: str) -> None:
    """Raises a MotiondeckError if a morph does not start in its source."""
    if not plays:
        raise MotiondeckError(f"a morph from '{source}' needs a network that plays '{source}'; cue it first")
