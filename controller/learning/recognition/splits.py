"""How a set of examples is split into training and test examples.

actor-out   each actor in turn is asked, the others are learned: will it know somebody new?
one-actor   one actor is learned, all others are asked: the hardest, and the one that still tells good methods apart
half        a random half of each class is learned, three times over; the same people are on both sides
"""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from motiondeck_base.errors import MotiondeckError

Protocol: TypeAlias = Literal["actor-out", "one-actor", "half"]
PROTOCOLS: tuple[Protocol, ...] = ("actor-out", "one-actor", "half")
Indices: TypeAlias = NDArray[np.int64]
Fold: TypeAlias = tuple[Indices, Indices]  # which examples are learned, which are asked

HALVES = 3


def folds(protocol: Protocol, labels: Indices, actors: Indices, seed: int = 0) -> list[Fold]:
    """The splits of a protocol.

    An example whose class is not among the learned ones cannot be named rightly and is not asked.

    Args:
        protocol: which one.
        labels, actors: of each example, shape (n,).
        seed: of the random halves.

    Raises:
        MotiondeckError: if there is only one actor where two are needed, or nothing is left to ask.
    """
    everyone = np.unique(actors)
    if protocol != "half" and len(everyone) < 2:
        raise MotiondeckError(f"protocol '{protocol}' needs recordings of two actors or more; use 'half'.")
    if protocol == "half":
        rng = np.random.default_rng(seed)
        learned = [_half(labels, rng) for _ in range(HALVES)]
    else:
        learned = [np.flatnonzero((actors == who) == (protocol == "one-actor")) for who in everyone]
    out = []
    for learn in learned:
        rest = np.setdiff1d(np.arange(len(labels)), learn)
        ask = rest[np.isin(labels[rest], labels[learn])]
        if len(ask) and len(np.unique(labels[learn])) > 1:
            out.append((learn, ask))
    if not out:
        raise MotiondeckError(
            f"protocol '{protocol}': no split has two classes to learn and an example to ask. Add recordings."
        )
    return out


def inner_folds(labels: Indices, actors: Indices, seed: int = 0) -> list[Fold]:
    """Splits of the learned examples themselves, to choose settings without looking at what will be asked.

    By actors where there are several, else into random halves.
    """
    several = len(np.unique(actors)) > 1
    return folds("actor-out" if several else "half", labels, actors, seed)


def _half(labels: Indices, rng: np.random.Generator) -> Indices:
    """A random half (rounded up) of each class."""
    chosen = []
    for label in np.unique(labels):
        own = rng.permutation(np.flatnonzero(labels == label))
        chosen.append(own[: (len(own) + 1) // 2])
    return np.sort(np.concatenate(chosen))
