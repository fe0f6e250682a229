"""Reads networks from the arrays and the header of a library file: every name, shape and type is checked."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array
from motiondeck_base.arrays_file import StoredArrays
from motiondeck_base.errors import FileFormatError

LEVELS: Array = np.linspace(-1.0, 1.0, 9)  # at which a motion's settled states are kept; between them they are mixed
FEWEST_ANCHORS = 3  # with fewer it is unknown how a motion moves


class PhaseScales(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """The sizes and scales with which the shared weights of a phase-driven network are drawn."""

    neurons: int  # N
    harmonics: int  # H of the phase
    spectral_radius: float  # of W, by the circular law: that of an infinitely large W
    input_scale: float  # of W_in
    phase_scale: float  # of W_phi, a in the equation
    bias_scale: float  # of b
    drive_scale: float = 0.0  # of W_u; 0 where no motion has an input besides the phase
    leads_in: bool = False  # whether the center turns before a one-shot begins; it stood up to version 5 of a library


class DrivingInput(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """An input besides the phase, such as speed, that changes a motion as it plays: its range, and a round's time.

    A motion that was learned from recordings which differ in it has one set of weights for all of them; the input,
    scaled to [-1, 1] over what was learned, goes into the reservoir like the phase, while loading and while playing.
    """

    name: str  # such as "speed"
    values: tuple[float, ...]  # that the motion was learned at, rising, in the input's own unit
    seconds: tuple[float, ...]  # of a round at each
    usual: float  # the value while none is given

    @property
    def possible(self) -> bool:
        """Whether there are at least two rising values, each with its time, and the usual one lies among them."""
        numbers = np.array([*self.values, *self.seconds, self.usual])
        if not (len(self.values) == len(self.seconds) > 1 and np.isfinite(numbers).all()):
            return False
        rising = min(np.diff(self.values)) > 0.0 and min(self.seconds) > 0.0
        return bool(rising and self.values[0] <= self.usual <= self.values[-1])

    def level(self, value: float) -> float:
        """The value as the reservoir gets it, in [-1, 1]; values beyond what was learned count as its ends."""
        least, most = self.values[0], self.values[-1]
        return 2.0 * (min(max(value, least), most) - least) / (most - least) - 1.0

    def pace(self, level: float) -> float:
        """Rate factor relative to the usual value; its logarithm is linear between values."""
        known = [self.level(value) for value in self.values]
        usual, there = np.interp([self.level(self.usual), level], known, np.log(self.seconds))
        return float(np.exp(usual - there))


class MotionHeader(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The fields of a motion in a library's header that its network reads."""

    name: str
    plays: Literal["loop", "once"]  # "loop" goes on for ever, "once" ends in a pose and holds it
    frames: int  # that it was learned from
    input: DrivingInput | None = None  # besides the phase, of a motion learned from recordings that differ in it


class NetworkHeader(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The fields of a library's header that its network reads."""

    motions: Sequence[MotionHeader]  # that it plays
    rate: float  # frames per second
    seed: int  # of everything random in training
    leak: float = 1.0  # of an echo-state network, else 1
    clipped: bool = True  # whether an echo-state network keeps its state and output in the range of training
    scales: PhaseScales | None = None  # of the weights that phase-driven motions share, drawn with the seed


@dataclass(frozen=True)
class StoredNetwork:
    """The arrays of a file with its header; `channels` of a frame follow from the encoding."""

    stored: StoredArrays
    header: NetworkHeader
    channels: int

    def read(
        self, at: str, sizes: dict[str, int], dtype: type | tuple[type, ...] = np.float32, **shapes: str
    ) -> dict[str, NDArray[Any]]:
        """Arrays by name, each with its axes as letters, such as recurrent="nk"; `at` begins all names.

        A letter that is not among the sizes takes the size of the first axis that has it. FileFormatError if an array
        is missing, or has another shape or type.
        """
        for name, letters in shapes.items():
            for axis, letter in enumerate(letters):
                if letter not in sizes:
                    sizes[letter] = self.stored.size(at + name, axis)
        shaped = {name: [sizes[letter] for letter in letters] for name, letters in shapes.items()}
        return {name: self.stored.take(at + name, *shape, kind=dtype) for name, shape in shaped.items()}

    def anchors(self, at: str) -> int:
        """The number of stored states of a motion; FileFormatError if they are fewer than FEWEST_ANCHORS."""
        count = self.stored.size(at + "states")
        if count < FEWEST_ANCHORS:
            raise self.error(f"'{at}states' holds {count} anchors; {FEWEST_ANCHORS} are the fewest")
        return count

    def normalisation(self, at: str = "") -> Normalisation:
        """Between normalised channels and the encoding's units."""
        arrays = self.read(at, {"c": self.channels}, np.float64, shift="c", scaling="c")
        with FileFormatError.placed(self.stored.path):
            return Normalisation(**arrays)

    def error(self, problem: str) -> FileFormatError:
        """An error that names the file."""
        return FileFormatError(f"{self.stored.path}: {problem}")


def arrays_of(part: Any, at: str) -> dict[str, NDArray[Any]]:
    """The arrays of a dataclass, by names that begin with `at`."""
    return {f"{at}{field.name}": getattr(part, field.name) for field in fields(part)}
