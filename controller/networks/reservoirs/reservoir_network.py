"""Base classes of reservoir networks, and of those that run by themselves."""

from abc import abstractmethod
from typing import Any, Self

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


def require_playing(plays: bool, source: str) -> None:
    """Raises a MotiondeckError if a morph does not start in its source."""
    if not plays:
        raise MotiondeckError(f"a morph from '{source}' needs a network that plays '{source}'; cue it first")
