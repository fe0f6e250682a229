"""The base class of reservoir networks."""

from abc import abstractmethod
from typing import Self

import numpy as np
from numpy.typing import NDArray

from controller.networks.base import Motion, Network
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


def require_playing(plays: bool, source: str) -> None:
    """Raises a MotiondeckError if a morph does not start in its source."""
    if not plays:
        raise MotiondeckError(f"a morph from '{source}' needs a network that plays '{source}'; cue it first")
