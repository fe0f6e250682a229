"""Finds motions by the frequencies of their centers (Vakulenko et al. 2017, section 4).

Vectors of frequencies are short and can be indexed: a k-d tree of their logarithms finds the nearest among a hundred
thousand in well under a millisecond. Where frequencies are learned for parts of the body, weights say which parts
count; they scale the question and the tree alike and need a tree of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from scipy.spatial import KDTree

from controller.motion.rotations import Array
from controller.networks.centralized.centers import require_frequencies
from motiondeck_base.arrays_file import Kind, read_arrays, write_arrays
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.toml_file import shaped

KIND = Kind("motion index", "motiondeck-index", 1, "`python -m benchmarks frequencies index`")


class IndexHeader(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """What the rows of an index file are."""

    version: int
    names: list[str]


@dataclass(frozen=True)
class Likeness:
    """A stored motion and how far its frequencies are from those asked for.

    Attributes:
        name: of the motion.
        distance: weighted root mean square difference of the logarithms: 0.1 means about a tenth faster or slower.
    """

    name: str
    distance: float


class MotionIndex:
    """Motions by their frequencies.

    Args:
        names: of the motions.
        frequencies: of each, shape (N, f), rad/s; the centers of each part of the body, slowest first.
        weights: how much each frequency counts, shape (f,); all alike if None.

    Raises:
        MotiondeckError: if there are no motions, shapes disagree or weights are not positive; FrequencyError if a
            frequency is not.
    """

    def __init__(self, names: list[str], frequencies: Array, weights: Array | None = None) -> None:
        if frequencies.ndim != 2 or len(names) != len(frequencies) or not names:
            raise MotiondeckError(
                f"{len(names)} motions with frequencies of shape {frequencies.shape}: one row a motion"
            )
        weights = np.ones(frequencies.shape[1]) if weights is None else weights
        if weights.shape != frequencies.shape[1:] or not (np.isfinite(weights) & (weights >= 0.0)).all():
            raise MotiondeckError(
                f"{weights.shape} weights for {frequencies.shape[1]} frequencies; none may be negative"
            )
        if not weights.any():
            raise MotiondeckError("all weights are zero: nothing would be compared")
        if not (np.isfinite(frequencies) & (frequencies > 0.0)).all():
            raise MotiondeckError(f"motion '{names[_first_bad(frequencies)]}' has a frequency that is not positive")
        self.names = names
        self._scale = np.sqrt(weights / weights.sum())
        self._tree = KDTree(np.log(frequencies) * self._scale)

    def nearest(self, frequency: Array, count: int = 5) -> list[Likeness]:
        """The motions whose frequencies are nearest to (f,), the nearest first.

        Raises:
            FrequencyError: if a frequency is not positive.
            MotiondeckError: if there are more or fewer frequencies than the motions have.
        """
        if frequency.shape != self._scale.shape:
            raise MotiondeckError(f"{len(frequency)} frequencies; these motions have {len(self._scale)}")
        require_frequencies(frequency)
        distances, rows = map(
            np.atleast_1d, self._tree.query(np.log(frequency) * self._scale, k=min(count, len(self.names)))
        )
        return [Likeness(self.names[int(row)], float(distance)) for row, distance in zip(rows, distances, strict=True)]


def _first_bad(frequencies: Array) -> int:
    return int(np.flatnonzero(~(np.isfinite(frequencies) & (frequencies > 0.0)).all(axis=1))[0])


def save_index(names: list[str], frequencies: Array, path: Path) -> None:
    """Writes motions and their numbers, shape (N, f), into a file of their own.

    Raises:
        FileFormatError: if the folder cannot be written.
    """
    write_arrays(path, KIND, IndexHeader(KIND.version, names), {"frequencies": frequencies})


def load_index(path: Path) -> tuple[list[str], Array]:
    """The motions of an index file and their numbers, shape (N, f).

    Raises:
        FileFormatError: one line that names the file and what is wrong with it.
    """
    header, stored = read_arrays(path, KIND)
    names = shaped(header, IndexHeader, f"{path} (header)").names
    frequencies = stored.take("frequencies", len(names), stored.size("frequencies", 1), kind=np.float64)
    stored.finish()
    return names, frequencies
