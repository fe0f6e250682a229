"""Motions as input of a trainer."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array
from controller.networks.storage import DrivingInput


@dataclass(frozen=True)
class Variant:
    """A loop at one value of its input."""

    value: float  # of the input, in its unit
    seconds: float  # duration of a round
    frames: Array  # channels, shape (T, C), aligned with the other variants


@dataclass(frozen=True)
class TrainingMotion:
    """One motion to learn."""

    name: str
    frames: Array  # normalised channels, shape (T, C): one period of a loop, or all of a one-shot
    loop: bool
    before: Array | None = None  # recorded frames before these, shape (T', C), or None
    driving: DrivingInput | None = None  # its input besides the phase, if any; `frames` are those at the usual value
    variants: tuple[Variant, ...] = ()  # the motion at each value of the input, normalised too
    turn: float = 0.0  # of a loop: the phase that a reservoir sees at its first frame, rad

    def lead_in(self, washout: int) -> Array:
        """The frames for the washout, shape (washout, C): as recorded, the end of a loop, or the first frame."""
        if self.before is not None:
            return self.before
        if self.loop:
            repeats = -(-washout // len(self.frames))
            return np.concatenate([self.frames] * repeats)[len(self.frames) * repeats - washout :]
        return np.repeat(self.frames[:1], washout, axis=0)


@dataclass(frozen=True)
class Lessons:
    """The motions that a network learns."""

    motions: Sequence[TrainingMotion]  # normalised
    normalisation: Normalisation  # between their channels and the encoding's units
    rate: float  # frames per second, Hz
    # Of frames (T, C) in the encoding's units, shape (T, F): by these loops are alike.
    features: Callable[[Array], Array] = lambda frames: frames


class MotionsOnDemand(Sequence[TrainingMotion]):
    """The motions of some names, each made when it is asked for, so that not all of them are in memory."""

    def __init__(self, names: Sequence[str], make: Callable[[str], TrainingMotion]) -> None:
        self._names, self._make = names, make

    def __len__(self) -> int:
        return len(self._names)

    def __getitem__(self, index: Any) -> Any:
        found = self._names[index]
        return self._make(found) if isinstance(found, str) else [*map(self._make, found)]
