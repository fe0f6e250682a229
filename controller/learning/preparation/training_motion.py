"""One motion as a trainer sees it, and the signal that drives a reservoir with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.motion.rotations import Array
from controller.networks.driving_input import DrivingInput


@dataclass(frozen=True)
class Variant:
    """A loop at one value of its input.

    Attributes:
        value: of the input, in its own unit.
        seconds: how long a round takes.
        frames: channels, shape (T, C), in step with the other variants.
    """

    value: float
    seconds: float
    frames: Array


@dataclass(frozen=True)
class TrainingMotion:
    """One motion to learn.

    Attributes:
        name: of the motion.
        frames: normalised channels, shape (T, C): one period of a loop, or all of a one-shot.
        loop: which of the two it is.
        before: what was recorded before the frames, shape (T', C), or None.
        driving: its input besides the phase, if it has one; its frames are those at the usual value.
        variants: the motion at each of the input's values, normalised too.
    """

    name: str
    frames: Array
    loop: bool
    before: Array | None = None
    driving: DrivingInput | None = None
    variants: tuple[Variant, ...] = ()

    def lead_in(self, washout: int) -> Array:
        """What precedes the frames while the reservoir forgets its start, shape (washout, C).

        Where nothing was recorded before them, a loop is preceded by its own end, a one-shot by its
        first frame.
        """
        if self.before is not None:
            return self.before
        if self.loop:
            repeats = -(-washout // len(self.frames))
            return np.concatenate([self.frames] * repeats)[len(self.frames) * repeats - washout :]
        return np.repeat(self.frames[:1], washout, axis=0)
