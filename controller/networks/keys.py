"""Keys of a motion: a cubic spline through a few moments, in as many bits as an error allows.

Channels y at a time u, counted in keys, are a uniform cubic B-spline

    y(u) = sum_j b(u - j) key_j,    key = step (least + n),  n = 0, 1, ..., 2^bits - 1

round and round in a loop. The step is the same of a direction, a m, m/s and rad; each channel takes as many bits as
the range of its keys needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array, Indices
from controller.networks.storage import StoredNetwork

FEWEST_KEYS = 4  # of a cubic
STEPS_PER_BIT = 8  # the fineness in which steps are chosen
MOST_BITS = 16  # of a key


@dataclass(frozen=True)
class Keys:
    """K keys of C channels, as a library stores them."""

    packed: NDArray[np.uint8]  # n of all keys, channel by channel, lowest bit first
    bits: NDArray[np.uint8]  # of a key of each channel, shape (C,)
    least: NDArray[np.int16]  # shape (C,)
    # K, frames at the end that hold the last one, -log2 of the step * STEPS_PER_BIT, and pieces of a network's phase
    course: NDArray[np.int32]

    @classmethod
    def of(cls, keys: Array, held: int, fineness: int, pieces: int = 1) -> Self:
        """Keys (K, C), rounded to steps of 2^(-fineness / STEPS_PER_BIT), or as fine as 16 bits hold."""
        fineness = min(fineness, int(STEPS_PER_BIT * np.log2(2 ** (MOST_BITS - 1) / (1.0 + np.abs(keys).max()))))
        whole = np.rint(keys * 2.0 ** (fineness / STEPS_PER_BIT)).astype(np.int64)
        least = whole.min(0)
        above = whole - least
        bits = np.array([int(most).bit_length() for most in above.max(0)], dtype=np.uint8)
        parts = [((above[:, [c]] >> np.arange(own)) & 1).ravel() for c, own in enumerate(bits)]
        packed = np.packbits(np.concatenate(parts).astype(np.uint8))
        return cls(packed, bits, least.astype(np.int16), np.array([len(keys), held, fineness, pieces], dtype=np.int32))

    @property
    def counted(self) -> Indices:
        """The keys in steps, shape (K, C), in the range of 16 bits."""
        count, flags = int(self.course[0]), np.unpackbits(self.packed)
        parts = [
            flags[end - count * own : end].reshape(count, own) @ (1 << np.arange(own))
            for own, end in zip(self.bits.tolist(), np.cumsum(count * self.bits.astype(np.int64)), strict=True)
        ]
        return np.stack(parts, 1) + self.least.astype(np.int64)

    @property
    def unit(self) -> float:
        """The step in which keys are counted."""
        return 2.0 ** (-int(self.course[2]) / STEPS_PER_BIT)

    def drawn(self, frames: int, *, loop: bool) -> Array:
        """The channels of all frames of a motion, shape (frames, C)."""
        count, held, keys = int(self.course[0]), int(self.course[1]), self.counted * self.unit
        near, weights = spline(frames - held, count, loop=loop)
        moving = (weights[..., None] * keys[near]).sum(1)
        return np.concatenate([moving, np.repeat(moving[-1:], held, axis=0)])

    @classmethod
    def load(cls, stored: StoredNetwork, at: str, frames: int) -> Self:
        """The keys of a motion of some frames; FileFormatError if they cannot be drawn."""
        sizes = {"c": stored.channels}
        bits = stored.read(at, sizes, np.uint8, bits="c")["bits"]
        course = stored.stored.take(f"{at}course", 4, kind=np.int32)
        count, held, fineness, pieces = course.tolist()
        most = int(bits.max(initial=0))
        if not (FEWEST_KEYS <= count <= 2 * frames and 0 <= held < frames - 1 and 0 < pieces <= frames):
            raise stored.error(f"'{at}course': {count} keys, {held} frames held, {pieces} pieces, of {frames} frames")
        if not (most <= MOST_BITS and 0 <= fineness <= MOST_BITS * STEPS_PER_BIT):
            raise stored.error(f"'{at}course': keys of {most} bits in steps of 2^-{fineness / STEPS_PER_BIT:g}")
        size = -(-count * int(bits.sum(dtype=np.int64)) // 8)
        packed = stored.stored.take(f"{at}packed", size, kind=np.uint8)
        return cls(packed, bits, stored.read(at, sizes, np.int16, least="c")["least"], course)


def spline(frames: int, keys: int, *, loop: bool) -> tuple[Indices, Array]:
    """The four keys of each frame of a cubic B-spline and their weights, shape (frames, 4) each."""
    way = np.arange(frames) * (keys / frames if loop else (keys - 3) / (frames - 1))
    first = np.minimum(way.astype(np.int64), keys - (1 if loop else 4))
    u = way - first
    weights = np.stack([(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3], axis=1) / 6
    return (first[:, None] + np.arange(4)) % keys, weights
