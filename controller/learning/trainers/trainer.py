"""The interface of trainers, one for each kind of network, in a file here named as its folder in `networks`."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import Any, ClassVar, Generic, Protocol, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from controller.learning.measures.self_test import Judge
from controller.learning.preparation.training_motion import Lessons, TrainingMotion
from controller.motion.encodings.encoding import Encoding
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array
from controller.networks.base import AnyNetwork
from controller.networks.registry import network_kinds
from motiondeck_base.errors import MotiondeckError

FARTHEST = 50.0  # half ranges of a channel in the stored motions: beyond it no reservoir can follow
STILL = 1e-3  # m, m/s, rad, or of a direction: what moves less stands still


def nrmse(output: Array, target: Array) -> float:
    """Mean over channels of sqrt(mean squared error / mean of both variances), the measure behind the thesis's tables.

    Eq. 3.3 of Deliallisi 2017 as printed divides by the variance of the error itself and is always about 1; the tables
    come from this definition. Both have shape (T, C), else a MotiondeckError; channels that never move are left out.
    """
    output, target = np.asarray(output), np.asarray(target)
    if output.shape != target.shape:
        raise MotiondeckError(f"an output of shape {output.shape} and a target of shape {target.shape} do not compare")
    variance = 0.5 * (output.var(0) + target.var(0))
    moving = target.var(0) > 1e-12
    if not moving.any():
        return 0.0
    squared = np.square(output - target).mean(0)[moving]
    return float(np.sqrt(squared / variance[moving]).mean())


def mabs(weights: NDArray[np.floating]) -> float:
    """The mean absolute value of a matrix (eq. 3.5): the smaller, the less a network overfits."""
    return float(np.abs(weights).mean())


class NetworkRecipe(Protocol):
    """The parameters of a kind of network: a msgspec struct whose tag is the kind's."""

    __struct_fields__: ClassVar[tuple[str, ...]]

    @property
    def anchor_every(self) -> int:
        """Frames between the states that a motion can be entered at."""
        ...


Recipe = TypeVar("Recipe", bound=NetworkRecipe)


@dataclass(frozen=True)
class SettledNetwork:
    """A trained network."""

    network: AnyNetwork
    failed: dict[str, int] = field(default_factory=dict[str, int])  # trials of each motion
    weights: NDArray[np.float32] | None = None  # W of a conceptor network, shape (N, N)


@dataclass(frozen=True)
class NewMotion:
    """A motion that a library is to learn besides its own."""

    library: str  # name
    encoding: Encoding
    rate: float
    seed: int
    lengths: dict[str, int]  # frames of the stored motions
    name: str
    frames: Array  # in the encoding's units
    loop: bool

    @property
    def judge(self) -> Judge:
        """Judges by the motion alone."""
        return Judge(self.encoding, {self.name: self.frames}, {self.name: self.loop}, self.rate)

    def scaled(self, normalisation: Normalisation) -> TrainingMotion:
        """The motion, normalised as the stored ones are; MotiondeckError if it moves what stands still in them all."""
        scaled = normalisation.apply(self.frames)
        unscaled = np.abs(self.frames + normalisation.shift)[:, normalisation.scaling == 0.0]
        if np.abs(scaled).max() > FARTHEST or (unscaled > STILL).any():
            raise MotiondeckError(
                f"the motion moves parts that stand still in all motions of the library '{self.library}'. "
                "Train all of them together, with `motiondeck learn`."
            )
        return TrainingMotion(self.name, scaled, self.loop)


@dataclass(frozen=True)
class TrainingError:
    """The result of one seed."""

    seed: int
    mabs_readout: float  # of W_out; means over the motions where their readouts differ
    nrmse_readout: float  # likewise
    mabs_weights: float | None  # of W, where it was learned in full
    nrmse_weights: float | None  # likewise
    network: AnyNetwork


class Trainer(ABC, Generic[Recipe]):
    """Trains one kind of network."""

    recipe: type[Recipe]  # the parameters, a struct whose tag is the kind's
    # Whether centers drive the network, so that it needs closed loops and ends that hold.
    center_driven: ClassVar[bool] = False
    takes_inputs: ClassVar[bool] = False  # whether a motion may have an input besides the phase
    # Of a channel in its normalisation (of a direction, m, m/s, rad): a motion that is added later may move what stands
    # still in all others.
    least_range: ClassVar[float] = 0.0
    stress_tested: ClassVar[bool] = True  # whether the self-test disturbs the network
    noise_note: ClassVar[str] = ""  # on disturbances of a trained network, for reports
    stored_noise_note: ClassVar[str] = ""  # of one from a library

    def problems(self, recipe: Recipe, motions: Sequence[str]) -> Iterator[str]:
        """The problems of a recipe for these motions, besides sizes and scales out of range."""
        return iter(())

    def sized(
        self, recipe: Recipe, lessons: Lessons, seed: int, judge: Judge, progress: Callable[[str], None]
    ) -> Recipe:
        """The recipe with the sizes that it leaves open."""
        return recipe

    @abstractmethod
    def train(self, recipe: Recipe, lessons: Lessons, seed: int) -> AnyNetwork:
        """One network that holds all motions, untested."""

    def settle(self, recipe: Recipe, lessons: Lessons, seed: int, judge: Judge) -> SettledNetwork:
        """The network with the parameters that hold in trials, where the recipe chooses any."""
        return SettledNetwork(self.train(recipe, lessons, seed))

    def add(self, recipe: Recipe, network: Any, motion: NewMotion) -> AnyNetwork:
        """The network with one more motion; MotiondeckError if it cannot be added to."""
        raise MotiondeckError(
            f"library '{motion.library}' holds a {network.kind} network, which learns all motions at once; "
            "name the clip in its recipe and train it again"
        )

    def training_error(
        self, recipe: Recipe, lessons: Lessons, frames: Mapping[str, Array], seed: int, judge: Judge
    ) -> TrainingError:
        """Trains a recipe with a seed and measures it on the frames of each motion, in the encoding's units."""
        dense: Any = recipe
        if "anchor_every" in dense.__struct_fields__:  # one at every frame
            dense = msgspec.structs.replace(dense, anchor_every=1)
        network = self.settle(dense, lessons, seed, judge).network
        errors = [self.error_of(dense, network, name, part) for name, part in frames.items()]
        size = self.readout_size(network, lessons.normalisation.scaling)
        return TrainingError(seed, size, float(np.mean(errors)), None, None, network)

    def error_of(self, recipe: Any, network: Any, motion: str, frames: Array) -> float:
        """The NRMSE of a motion's readout at its anchors beside the frames (T, C) that it learned."""
        return nrmse(network.recall(motion), frames[:: recipe.anchor_every])

    def readout_size(self, network: Any, scaling: Array) -> float:
        """The mean absolute readout, of channels scaled to [-1, 1]."""
        return float(np.mean([mabs(network[name].readout) for name in network.motions]))


@cache
def trainer_named(kind: str) -> Trainer[Any]:
    """The trainer of a kind of network."""
    trainer: Trainer[Any] = import_module(f"controller.learning.trainers.{kind.replace('-', '_')}").TRAINER
    return trainer


def trainer_of(recipe: NetworkRecipe) -> Trainer[Any]:
    """The trainer that a recipe is for."""
    return trainer_named(kind_of(recipe))


def kind_of(recipe: NetworkRecipe) -> str:
    """The kind of network that a recipe describes."""
    own: Any = recipe
    return str(own.__struct_config__.tag)


def network_recipes() -> tuple[type[NetworkRecipe], ...]:
    """The recipes of all kinds."""
    return tuple(trainer_named(kind).recipe for kind in network_kinds())
