"""An input besides the phase: a number, such as speed, that changes a motion while it plays.

A motion that was learned from recordings which differ in the input has one set of weights for all of them; the input,
scaled to [-1, 1] over what was learned, goes into the reservoir like the phase does, while loading and while playing.
"""

import msgspec
import numpy as np

from controller.motion.rotations import Array

LEVELS: Array = np.linspace(-1.0, 1.0, 9)  # at which a motion's settled states are kept; between them they are mixed


class DrivingInput(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """The range of an input of a motion, and how long a round takes."""

    name: str  # such as "speed"
    values: tuple[float, ...]  # that the motion was learned at, rising, in the input's own unit
    seconds: tuple[float, ...]  # of a round at each
    usual: float  # the value while none is given

    @property
    def possible(self) -> bool:
        """Whether there are at least two rising values, each with its time, and the usual one lies among them."""
        numbers = np.array([*self.values, *self.seconds, self.usual])
        return bool(
            len(self.values) == len(self.seconds) > 1
            and np.isfinite(numbers).all()
            and min(np.diff(self.values)) > 0.0
            and min(self.seconds) > 0.0
            and self.values[0] <= self.usual <= self.values[-1]
        )

    def level(self, value: float) -> float:
        """The value as the reservoir gets it, in [-1, 1]; values beyond what was learned count as its ends."""
        least, most = self.values[0], self.values[-1]
        return 2.0 * (min(max(value, least), most) - least) / (most - least) - 1.0

    def pace(self, level: float) -> float:
        """Rate factor relative to the usual value; its logarithm is linear between values."""
        known = [self.level(value) for value in self.values]
        usual, there = np.interp([self.level(self.usual), level], known, np.log(self.seconds))
        return float(np.exp(usual - there))
