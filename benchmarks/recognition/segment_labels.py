"""Files of hand-marked segments of a recording (the format of Barbic et al. 2004).

7                      number of segments
1 walking              number and name of the first
500 550 600            its end: earliest acceptable, best, latest acceptable frame
...
7 punching
4579                   the last one ends with the recording
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import read_lines, shortened


@dataclass(frozen=True)
class Labels:
    """S segments of a recording of T frames.

    Attributes:
        names: behaviour in each segment, length S.
        borders: earliest, best and latest frame of the border between one segment and the next, shape (S - 1, 3).
        frames: T.
    """

    names: tuple[str, ...]
    borders: NDArray[np.int64]
    frames: int

    @property
    def classes(self) -> tuple[str, ...]:
        """The different names, in order of first occurrence."""
        return tuple(dict.fromkeys(self.names))

    def of_frames(self, stride: float = 1.0) -> NDArray[np.int64]:
        """The class of every `stride`-th frame, an index into `classes`."""
        at = np.arange(int(np.ceil(self.frames / stride))) * stride
        segment = np.searchsorted(self.borders[:, 1], at, side="right")
        return np.array([self.classes.index(name) for name in self.names])[segment]


def read_labels(path: Path) -> Labels:
    """The labels in a file.

    Raises:
        FileFormatError: naming file and line, if it does not follow the format.
    """
    lines = [(number, line.split()) for number, line in enumerate(read_lines(path), 1) if line.strip()]

    if not lines or len(lines[0][1]) != 1 or not lines[0][1][0].isdecimal():
        raise FileFormatError(f"{path}: does not begin with the number of its segments; is it a file of labels?")
    count = int(lines[0][1][0])
    if count < 1 or len(lines) != 1 + 2 * count:
        raise FileFormatError(
            f"{path}: announces {count} segments of two lines each, but {len(lines) - 1} lines follow."
        )
    names: list[str] = []
    ends: list[list[int]] = []
    for (_, title), (number, words) in zip(lines[1::2], lines[2::2], strict=True):
        if len(title) < 2:
            raise FileFormatError(f"{path} line {number - 1}: expected a segment's number and name.")
        names.append("_".join(title[1:]))
        ends.append(_frames(path, number, words))
        wanted = 1 if len(names) == count else 3
        if len(ends[-1]) not in (wanted, 3):
            raise FileFormatError(f"{path} line {number}: expected earliest, best and latest frame of the border.")
    # Two borders of the published labels are not in order; the widest reading is meant.
    borders = np.sort(np.array(ends[:-1], dtype=np.int64).reshape(-1, 3), axis=1)
    frames = max(ends[-1])
    best = [*borders[:, 1].tolist(), frames]
    if any(later <= earlier for earlier, later in pairwise(best)):
        raise FileFormatError(f"{path}: its borders do not follow each other in time.")
    return Labels(tuple(names), borders, frames)


def _frames(path: Path, number: int, words: list[str]) -> list[int]:
    """The frame numbers in a line."""
    if not all(word.isdecimal() and len(word) < 10 for word in words):
        raise FileFormatError(f"{path} line {number}: expected frame numbers, found '{shortened(' '.join(words))}'.")
    return [int(word) for word in words]
