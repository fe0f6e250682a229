"""Precision and recall of detected borders.

A marked border is a hit if a detected one lies between its earliest and latest accepted frame; each detected border
counts once at most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class BorderScore:
    """Numbers of hits, of found and of marked borders."""

    hits: int
    found: int
    marked: int

    @property
    def precision(self) -> float:
        """The share of found borders that are hits (1 if none was found)."""
        return self.hits / self.found if self.found else 1.0

    @property
    def recall(self) -> float:
        """The share of marked borders that were found (1 if there are none)."""
        return self.hits / self.marked if self.marked else 1.0

    @property
    def f1(self) -> float:
        """The harmonic mean of both: 2 hits / (found + marked)."""
        both = self.found + self.marked
        return 2.0 * self.hits / both if both else 1.0


def score_borders(found: NDArray[np.int64], accepted: NDArray[np.int64]) -> BorderScore:
    """Scores borders.

    Args:
        found: frames, shape (n,).
        accepted: earliest, best and latest frame of each marked border, shape (S, 3).
    """
    free = sorted(found.tolist())
    hits = 0
    # The interval that closes first takes the earliest border it can: no other pairing has more hits.
    for earliest, _, latest in sorted(accepted.tolist(), key=lambda border: border[2]):
        mine = next((frame for frame in free if earliest <= frame <= latest), None)
        if mine is not None:
            free.remove(mine)
            hits += 1
    return BorderScore(hits, len(found), len(accepted))
