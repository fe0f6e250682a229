"""Protocols that split examples into training and test sets.

actor-out   each actor is tested once, after training on the others: generalisation to a new person
one-actor   training on one actor, testing on all others: the hardest, which still separates good methods
half        training on a random half of each class, three times; the same people are in both sets
"""

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from motiondeck_base.errors import MotiondeckError

Protocol: TypeAlias = Literal["actor-out", "one-actor", "half"]
PROTOCOLS: tuple[Protocol, ...] = ("actor-out", "one-actor", "half")
Indices: TypeAlias = NDArray[np.int64]
Fold: TypeAlias = tuple[Indices, Indices]  # training and test examples

HALVES = 3


def folds(protocol: Protocol, labels: Indices, actors: Indices, seed: int = 0) -> list[Fold]:
    """The splits of examples with labels and actors (n,); classes that are not in the training set are not tested.

    MotiondeckError if there is only one actor and two are needed, or no test example is left.
    """
    names = np.unique(actors)
    if protocol != "half" and len(names) < 2:
        raise MotiondeckError(f"protocol '{protocol}' needs recordings of two actors or more; use 'half'.")
    if protocol == "half":
        rng = np.random.default_rng(seed)
        learned = [_half(labels, rng) for _ in range(HALVES)]
    else:
        learned = [np.flatnonzero((actors == name) == (protocol == "one-actor")) for name in names]
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
    """Splits of the training set for choosing parameters: by actors if there are several, else random halves."""
    several = len(np.unique(actors)) > 1
    return folds("actor-out" if several else "half", labels, actors, seed)


def _half(labels: Indices, rng: np.random.Generator) -> Indices:
    chosen = []
    for label in np.unique(labels):
        own = rng.permutation(np.flatnonzero(labels == label))
        chosen.append(own[: (len(own) + 1) // 2])
    return np.sort(np.concatenate(chosen))
