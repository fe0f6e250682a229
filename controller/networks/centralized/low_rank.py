"""Weights of low rank: a few curves made of satellites, and how much of each curve a channel has.

    W = B A,    x(t) = rest + B (A Phi(q(t)))

The outputs of a body move together, so W need not know each of them by itself. A curve is a sum of the first satellites
only, a strong one of many and a weak one of few; a channel has a share in those curves that matter to it. What is zero
is not stored.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError


@dataclass(frozen=True, eq=False)
class LowRankWeights:
    """W of rank r for D channels and m satellites; MotiondeckError if the shapes disagree."""

    shares: Array  # B, shape (D, r), mostly zeros
    curves: Array  # A, shape (r, m); a row holds zeros from some satellite on

    def __post_init__(self) -> None:
        if self.shares.ndim != 2 or self.curves.ndim != 2 or self.shares.shape[1] != len(self.curves):
            raise MotiondeckError(f"shares of shape {self.shares.shape} in curves of shape {self.curves.shape}")

    @property
    def rank(self) -> int:
        """r."""
        return len(self.curves)

    @property
    def matrix(self) -> Array:
        """W, shape (D, m)."""
        return self.shares @ self.curves

    @property
    def used(self) -> NDArray[np.int32]:
        """The number of satellites in each curve, shape (r,)."""
        counted = np.arange(1, self.curves.shape[1] + 1, dtype=np.int32)
        return np.where(self.curves != 0.0, counted, 0).max(axis=1, initial=0).astype(np.int32)

    @property
    def numbers(self) -> int:
        """The stored numbers; 32 flags that say where shares are zero count as one."""
        used = self.used
        return int(np.count_nonzero(self.shares) + used.sum() + len(used) + -(-self.shares.size // 32))


@dataclass(frozen=True, eq=False)
class PackedWeights:
    """Low-rank weights as a library stores them."""

    nonzero: NDArray[np.uint8]  # flags of B, D r bits row by row, the first the highest of its byte
    shares: NDArray[np.float32]  # B there, in the same order
    used: NDArray[np.int32]  # of how many satellites each curve is a sum, shape (r,)
    curves: NDArray[np.float32]  # A, what is used of its rows one after the other

    @classmethod
    def of(cls, weights: LowRankWeights) -> Self:
        """Weights as they are stored, rounded to single precision."""
        there, used = weights.shares != 0.0, weights.used
        filled = np.arange(weights.curves.shape[1]) < used[:, None]
        shares, curves = weights.shares[there].astype(np.float32), weights.curves[filled].astype(np.float32)
        return cls(np.packbits(there.ravel()), shares, used, curves)

    def unpack(self, channels: int, satellites: int) -> LowRankWeights:
        """The weights; MotiondeckError if there are more or fewer numbers than flags and counts ask for."""
        rank = len(self.used)
        if len(self.nonzero) != -(-channels * rank // 8):
            raise MotiondeckError(f"{len(self.nonzero)} bytes of flags for {channels} channels and {rank} curves")
        there = np.unpackbits(self.nonzero, count=channels * rank).reshape(channels, rank).astype(bool)
        if (self.used < 0).any() or (self.used > satellites).any():
            raise MotiondeckError(f"curves of {self.used} satellites, of which there are {satellites}")
        filled = np.arange(satellites) < self.used[:, None]
        if len(self.shares) != there.sum() or len(self.curves) != filled.sum():
            raise MotiondeckError(
                f"{len(self.shares)} shares and {len(self.curves)} weights of curves, where flags and counts ask for "
                f"{there.sum()} and {filled.sum()}"
            )
        shares, curves = np.zeros((channels, rank)), np.zeros((rank, satellites))
        shares[there], curves[filled] = self.shares, self.curves
        return LowRankWeights(shares, curves)
