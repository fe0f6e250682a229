"""Interfaces of networks, for the deck and for training: frame by frame, and in continuous time."""

# ruff: noqa: D102 (`Network` and `reservoirs.phase_driven.PhaseDrivenNetwork` document the methods of the protocols)

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from types import EllipsisType
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError, UnknownNameError

if TYPE_CHECKING:
    from controller.networks.storage import DrivingInput, StoredNetwork

Channels = NDArray[np.float64]
Float32 = NDArray[np.float32]
Activation = Float32
Rows = NDArray[np.int64] | EllipsisType  # the indices of some of several runs, or all of them

Motion = TypeVar("Motion")


class FrameNetwork(Protocol):
    """Plays one frame at a time and can be started from stored states, its anchors."""

    motions: tuple[str, ...]
    channels: int

    def anchors(self, motion: str) -> Channels: ...
    def cue(self, motion: str, anchor: int) -> None: ...
    def advance(self, out: Channels) -> None: ...
    @property
    def as_phase_network(self) -> PhaseNetwork | None: ...


class PhaseNetwork(FrameNetwork, Protocol):
    """A network with a phase: it knows how far the motion is, can be sent elsewhere, and may have further inputs."""

    @property
    def phase(self) -> float: ...
    def seek(self, motion: str, phase: float) -> None: ...
    def retreat(self, out: Channels) -> None: ...
    def period(self, motion: str) -> int: ...
    @property
    def inputs(self) -> dict[str, tuple[float, float]]: ...
    @property
    def pace(self) -> float: ...
    def set_input(self, name: str, value: float) -> None: ...


class Morph(Protocol):
    """A network on its way from one motion to another."""

    def advance(self, mu: float, out: Channels) -> None:
        """Steps one frame on with the share mu of the target and writes it into out, shape (channels,)."""

    def settle(self) -> None:
        """Leaves the network playing the target alone, from where the mixture is."""

    def give_up(self) -> None:
        """Leaves it playing the source alone."""


class AutonomousNetwork(FrameNetwork, Protocol):
    """A network that runs by itself: it may lose its place, and can mix two of its motions."""

    def snapshot(self) -> Any: ...
    def restore(self, snapshot: Any) -> None: ...
    def astray(self) -> Any:
        """Whether the state is one that undisturbed playing never reaches; of several runs, shape (R,)."""
        ...

    def cue(self, motion: str, anchor: Any, rows: Rows = ...) -> None:
        """Puts the network, or some of its runs, into the stored state of an anchor, or of one for each run."""

    def morph(self, source: str, target: str) -> Morph:
        """A morph that starts where the network is in the source (Deliallisi 2017, eqs 3.7, 3.16 and 3.17).

        mu = 0 is the source, mu = 1 the target; between them lies interpolation, beyond them extrapolation.
        MotiondeckError if the network does not play the source. UnknownNameError if there is no such motion.
        """
        ...


class NamedMotions(Generic[Motion]):
    """A table of at least one motion by name."""

    def __init__(self, motions: Mapping[str, Motion]) -> None:
        self._of = dict(motions)
        self.motions = tuple(motions)

    def __getitem__(self, motion: str) -> Motion:
        if motion not in self._of:
            raise UnknownNameError.among("motion", motion, self.motions)
        return self._of[motion]


class Network(NamedMotions[Motion], ABC):
    """A kind of network: plays, is stored and loaded; fits `FrameNetwork`.

    One implementation of the step serves one run and many: `twin(runs=R)` plays R runs of one motion side by side, and
    then frames, noise and states have a leading axis R.
    """

    kind: ClassVar[str]  # its name in files and recipes; the registry finds it by its folder
    by_module: ClassVar[bool] = False  # whether a switching module leads from one of its motions to another

    channels: int
    neurons: int = 0  # of all motions together
    runs: tuple[int, ...] = ()  # the leading shape, () or (R,)
    # Of the neurons in the last step, shape (*runs, N), overwritten by the next one; None without any.
    activation: Any = None

    @abstractmethod
    def twin(self, runs: int | None = None) -> Self:
        """The same weights with an independent state, of one run or of several."""

    def only(self, motions: Collection[str]) -> Self:
        """The network with some of its motions; with all of them where they cannot be taken apart."""
        return self

    def rest(self) -> None:
        """Frees what was computed from the stored arrays to play; it is computed again when a motion plays."""
        return

    @abstractmethod
    def anchors(self, motion: str) -> Channels:
        """The frames at the anchors of a motion, evenly spread over it in order, shape (anchors, channels)."""

    def recall(self, motion: str) -> Channels:
        """The readout at the stored states, shape (anchors, channels): by default the anchors."""
        return self.anchors(motion)

    @abstractmethod
    def cue(self, motion: str, anchor: int) -> None:
        """Puts the network into the stored state of an anchor; the next `advance` gives the frame after it."""

    @abstractmethod
    def advance(self, out: Channels, noise: Activation | None = None) -> None:
        """Steps one frame on and writes it into out, shape (*runs, channels); noise is added to the new state."""

    @abstractmethod
    def snapshot(self) -> Any:
        """A copy of the state: two runs from one snapshot are identical."""

    @abstractmethod
    def restore(self, snapshot: Any) -> None:
        """Puts the state back to a snapshot."""

    @abstractmethod
    def noise_size(self, motion: str) -> int:
        """The numbers of noise that a step of a motion takes."""

    @abstractmethod
    def displace(self, noise: Activation, weights: Activation | None = None) -> None:
        """Adds noise to the state; `weights` is W (N, N), for a network that keeps only directions of it."""

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The stored arrays by name: by default those of the motions, which are dataclasses of arrays."""
        from controller.networks.storage import arrays_of  # what plays needs none of it

        found: dict[str, NDArray[Any]] = {}
        for name in self.motions:
            found |= arrays_of(self[name], f"motion/{name}/")
        return found

    @property
    def stored_bytes(self) -> int:
        """The bytes of its arrays in a file."""
        return sum(array.nbytes for array in self.arrays().values())

    def header_fields(self) -> dict[str, Any]:
        """Fields of the library's header that belong to this kind."""
        return {}

    @classmethod
    @abstractmethod
    def load(cls, stored: StoredNetwork) -> Self:
        """The network that a file holds; FileFormatError if an array is missing or has another shape or type."""

    @property
    def as_phase_network(self) -> PhaseNetwork | None:
        """The network itself, if a phase drives it."""
        return None

    @property
    def as_autonomous(self) -> AutonomousNetwork | None:
        """The network itself, if it runs by itself."""
        return None

    def settled(self, motion: str) -> Channels | None:
        """The frames of a motion as it plays once transients have died away, shape (frames, channels), if known."""
        return None

    def driving(self, motion: str) -> DrivingInput | None:
        """The input of a motion besides the phase; None without one."""
        return None

    def center_phases(self, motion: str) -> Array | None:
        """The phases of a motion's centers at its beginning and end, shape (2, n), rad; None without centers."""
        return None

    @property
    def mixable(self) -> dict[str, Any]:
        """The motions whose conceptors can be mixed, by name: those that share all else. By default none."""
        return {}

    def sizes(self, motion: str) -> dict[str, float]:
        """The sizes of a motion's own network by name, where each motion has one."""
        return {}


class ReservoirNetwork(Network[Motion]):
    """N neurons and the motions that they have learned."""

    activation: Float32

    def __init__(self, motions: dict[str, Motion], neurons: int, channels: int, runs: tuple[int, ...] = ()) -> None:
        super().__init__(motions)
        self.neurons, self.channels, self.runs = neurons, channels, runs
        self.activation = np.zeros((*runs, neurons), dtype=np.float32)
        self._frame = np.zeros((*runs, channels), dtype=np.float32)

    @abstractmethod
    def with_motions(self, more: dict[str, Motion], runs: tuple[int, ...] = ()) -> Self:
        """The same reservoir with further motions, of one run or of several with a leading shape."""

    def twin(self, runs: int | None = None) -> Self:
        return self.with_motions({}, lead_shape(runs))

    def noise_size(self, motion: str) -> int:
        return self.neurons


def require_playing(plays: bool, source: str) -> None:
    """Raises a MotiondeckError if a morph does not start in its source."""
    if not plays:
        raise MotiondeckError(f"a morph from '{source}' needs a network that plays '{source}'; cue it first")


AnyNetwork = Network[Any]


def lead_shape(runs: int | None) -> tuple[int, ...]:
    """The leading shape of the states of one run, or of several."""
    return () if runs is None else (runs,)


class Generator(Protocol):
    """Plays motions in continuous time."""

    motions: tuple[str, ...]
    motion: str

    def cue(self, motion: str, phase: float = 0.0) -> None:
        """Starts a motion at a phase in [0, 1)."""

    def step(self, dt: float) -> Channels:
        """Goes dt seconds on and gives the channels there; the array is reused by the next step.

        A tempo is a factor on dt: 0 holds the motion. One with a phase also goes back, where dt is negative.
        """
        ...
