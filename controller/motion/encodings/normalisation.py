"""Normalises every channel to [-1, 1], jointly for all patterns of a library (Deliallisi 2017, eqs. 3.1 and 3.2).

    S' = (S + shift) * scaling,   shift = -(max S + min S) / 2,   scaling = 2 / (max S - min S)

The extremes are those of all patterns together, because one network plays them all.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError

_FLOAT32 = np.finfo(np.float32)


@dataclass(frozen=True, eq=False)
class Normalisation:
    """The map of C channels to [-1, 1] and back; MotiondeckError for other shapes, NaN or a negative scaling."""

    shift: Array  # shape (C,), in the channels' units
    scaling: Array  # shape (C,); 0 for a channel that is constant, which maps to 0 and back to its constant

    def __post_init__(self) -> None:
        if self.shift.ndim != 1 or self.shift.shape != self.scaling.shape:
            shapes = f"shift of shape {self.shift.shape} and scaling of shape {self.scaling.shape}"
            raise MotiondeckError(f"normalisation: {shapes}; expected one number a channel in both")
        if not (np.isfinite(self.shift).all() and np.isfinite(self.scaling).all() and np.all(self.scaling >= 0.0)):
            raise MotiondeckError("normalisation: a shift or a scaling is not finite, or a scaling is negative")

    @classmethod
    def fit(cls, patterns: Sequence[Array], least_range: float = 0.0) -> Self:
        """The joint normalisation of patterns (T, C).

        A channel whose range float32 cannot resolve counts as constant: scaled up, it would be rounding noise. One with
        less than `least_range` is scaled by this, since a motion that is added later may move it. MotiondeckError if
        there is no frame, the patterns differ in their channels, or a number is not finite.
        """
        if not patterns or any(p.ndim != 2 or p.shape[1] != patterns[0].shape[1] or len(p) == 0 for p in patterns):
            raise MotiondeckError(
                f"normalisation: patterns of shape {[p.shape for p in patterns]}; expected frames x channels, the same"
            )
        low = np.min([pattern.min(axis=0) for pattern in patterns], axis=0).astype(np.float64)
        high = np.max([pattern.max(axis=0) for pattern in patterns], axis=0).astype(np.float64)
        with np.errstate(all="ignore"):  # the error below names the channel, a warning would not
            bad = np.flatnonzero(~np.isfinite(high - low))
        if len(bad):
            raise MotiondeckError(f"normalisation: channel {bad[0]} holds a number that is not finite or far too large")
        resolution = np.maximum(_FLOAT32.eps * np.maximum(np.abs(low), np.abs(high)), _FLOAT32.tiny)
        varies = high - low > resolution
        spread = np.maximum(np.where(varies, high - low, 0.0), least_range)
        known = spread > 0.0
        return cls(shift=-0.5 * (low + high), scaling=np.where(known, 2.0 / np.where(known, spread, 1.0), 0.0))

    @cached_property
    def _half_range(self) -> Array:
        """1 / scaling, and 0 for constant channels: a product is cheaper in the loop than a division."""
        varies = self.scaling > 0.0
        return np.where(varies, 1.0 / np.where(varies, self.scaling, 1.0), 0.0).astype(self.scaling.dtype)

    def apply(self, channels: Array) -> Array:
        """Channels (..., C) scaled to [-1, 1] (beyond it where they exceed the fitted range)."""
        return (channels + self.shift) * self.scaling

    def invert(self, channels: Array) -> Array:
        """The inverse of `apply`."""
        return channels * self._half_range - self.shift

    def invert_in_place(self, channels: Array) -> None:
        """`invert` in place, for float64, without allocation."""
        np.multiply(channels, self._half_range, out=channels)
        np.subtract(channels, self.shift, out=channels)
