"""Base classes of reservoir networks, and of those that run by themselves."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from controller.networks.base import AutonomousNetwork, Morph, Motion, Network, Rows
from motiondeck_base.errors import MotiondeckError

Float32 = NDArray[np.float32]


class ReservoirNetwork(Network[Motion]):
    """N neurons and the motions that they have learned.

    Args:
        motions: by name.
        neurons: N.
        channels: of a frame.
        runs: the leading shape of all states, () or (R,).

    Attributes:
        neurons: N.
    """

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
        """The same weights with an independent state, of one run or of several."""
        return self.with_motions({}, runs)

    def noise_size(self, motion: str) -> int:
        """N."""
        return self.neurons


class AutonomousReservoir(ReservoirNetwork[Motion]):
    """A reservoir that runs by itself; fits `base.AutonomousNetwork`."""

    @property
    def as_autonomous(self) -> AutonomousNetwork:
        """The network itself."""
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

        Raises:
            MotiondeckError: if the network does not play the source.
            UnknownNameError: if there is no such motion.
        """


def lead_shape(runs: int | None) -> tuple[int, ...]:
    """The leading shape of the states of one run, or of several."""
    return () if runs is None else (runs,)


def squared_length(states: Float32) -> Any:
    """|z|^2 of a state (k,), or of states (R, k)."""
    return np.dot(states, states) if states.ndim == 1 else np.square(states).sum(1)


def require_playing(plays: bool, source: str) -> None:
    """Checks that a morph starts in its source.

    Raises:
        MotiondeckError: if it does not.
    """
    if not plays:
        raise MotiondeckError(f"a morph from '{source}' needs a network that plays '{source}'; cue it first")
