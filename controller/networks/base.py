"""What is asked of a network, whatever is inside: frame by frame, as the deck plays it, and in continuous time."""

from __future__ import annotations

from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Channels = NDArray[np.float64]
Activation = NDArray[np.float32]


class FrameNetwork(Protocol):
    """A network that plays one frame at a time and can be started from stored states, its anchors.

    Attributes:
        motions: the names of what it has learned.
        channels: how many channels a frame has.
    """

    motions: tuple[str, ...]
    channels: int

    def anchors(self, motion: str) -> Channels:
        """The frames at the anchors of a motion, evenly spread over it in order, shape (anchors, channels)."""
        ...

    def cue(self, motion: str, anchor: int) -> None:
        """Puts the network into a stored state; the next `advance` gives the frame after it."""
        ...

    def advance(self, out: Channels) -> None:
        """Steps one frame on and writes it into out, shape (channels,)."""
        ...

    def snapshot(self) -> Any:
        """A copy of the state: two runs from one snapshot are identical."""
        ...

    def restore(self, snapshot: Any) -> None:
        """Puts the state back to a snapshot."""
        ...


@runtime_checkable
class NeuronNetwork(FrameNetwork, Protocol):
    """A frame network of neurons that one can look at."""

    @property
    def activation(self) -> Activation:
        """The activation of the neurons in the last step, shape (N,); the next step overwrites it."""
        ...

    def twin(self) -> Self:
        """The same weights with a state of its own."""
        ...


@runtime_checkable
class CrossingNetwork(FrameNetwork, Protocol):
    """A frame network that can cross from one motion to another, by a switching module of its own."""

    @property
    def crossing(self) -> bool:
        """Whether it is crossing."""
        ...

    def cross(self, motion: str, entries: int) -> int:
        """Begins to cross to the one of the first anchors of a motion that suits best; returns which."""
        ...


@runtime_checkable
class PhaseNetwork(FrameNetwork, Protocol):
    """A frame network that a center drives: it knows where in the motion it is, and can be sent elsewhere."""

    @property
    def phase(self) -> float:
        """How far the motion is: [0, 1) in a loop, 0 to 1 in a one-shot, which then holds its end."""
        ...

    def seek(self, motion: str, phase: float) -> None:
        """Goes to the frame of a motion that is nearest to a phase; the next `advance` gives the frame after it."""
        ...

    def retreat(self, out: Channels) -> None:
        """Steps one frame back and writes it into out, shape (channels,)."""
        ...


@runtime_checkable
class InputNetwork(PhaseNetwork, Protocol):
    """A phase-driven network some of whose motions have inputs besides the phase."""

    @property
    def inputs(self) -> dict[str, tuple[float, float]]:
        """The names of the inputs, and between which values each was learned."""
        ...

    @property
    def pace(self) -> float:
        """How many frames are played in the time of one, because of the input."""
        ...

    def set_input(self, name: str, value: float) -> None:
        """Gives an input another value, from the next step on."""
        ...


class Generator(Protocol):
    """Plays motions in continuous time.

    Attributes:
        motions: the names of what it can play.
        motion: the one it plays.
    """

    motions: tuple[str, ...]
    motion: str

    def cue(self, motion: str, phase: float = 0.0) -> None:
        """Starts a motion at a phase in [0, 1)."""
        ...

    def step(self, dt: float) -> Channels:
        """Goes dt seconds on and gives the channels there; the array is reused by the next step.

        A tempo is a factor on dt: 0 holds the motion. One with a phase also goes back, where dt is negative.
        """
        ...
