"""What all networks of neurons have in common: motions by name, and twins that share every weight."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Self

import numpy as np
from numpy.typing import NDArray

from controller.networks.base import Channels
from controller.networks.named_motions import Motion, NamedMotions

Float32 = NDArray[np.float32]


class ReservoirNetwork(NamedMotions[Motion], ABC):
    """A reservoir and the motions that it has learned; fits `base.NeuronNetwork` once the rest is there.

    Args:
        motions: what it plays.
        neurons: N.
        channels: of a frame.

    Attributes:
        neurons, channels: the same.
        activation: of the neurons in the last step, shape (N,); the next step overwrites it.
    """

    def __init__(self, motions: dict[str, Motion], neurons: int, channels: int) -> None:
        super().__init__(motions)
        self.neurons, self.channels = neurons, channels
        self.activation: Float32 = np.zeros(neurons, dtype=np.float32)
        self._frame = np.zeros(channels, dtype=np.float32)

    @abstractmethod
    def with_motions(self, more: dict[str, Motion]) -> Self:
        """The same reservoir with further motions."""

    def twin(self) -> Self:
        """The same weights with a state of its own: what one player does, another does not see."""
        return self.with_motions({})

    @abstractmethod
    def anchors(self, motion: str) -> Channels:
        """The frames at the anchors of a motion, shape (anchors, channels)."""

    def recall(self, motion: str) -> Channels:
        """What the readout makes of the stored states, shape (anchors, channels): what the anchors are."""
        return self.anchors(motion)
