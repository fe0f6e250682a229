"""How well unknown motions are distinguished from known ones: each class in turn is left out of the training.

Confidence is the margin, how far the best expert is ahead of the second, less a share of the best one's cost: an
unknown motion is predicted badly by all. Area under the ROC curve: the share of pairs of a known and an unknown example
in which the known one has the greater confidence.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import rankdata

from benchmarks.recognition.methods import Scorer
from controller.learning.recognition.experts import margins
from controller.learning.recognition.labelled_recordings import Fold, Protocol, folds
from controller.motion.rotations import Array, Indices
from motiondeck_base.errors import MotiondeckError

FEWEST_CLASSES = 4  # a margin takes two that are learned


@dataclass(frozen=True)
class Doubter:
    """What tells known motions from unknown ones.

    Attributes:
        score: the costs of the classes.
        level: the share of the best cost that is taken from the margin.
    """

    score: Scorer
    level: float = 0.0

    def confidence(self, learn: Indices, ask: Indices) -> Array:
        """How sure it is that each asked example is one of the learned classes, shape (len(ask),)."""
        costs = self.score(learn, ask)
        costs = costs[:, np.isfinite(costs).all(0)]
        return margins(costs) - self.level * costs.min(1)


def unknown_auc(doubter: Doubter, labels: Indices, actors: Indices, protocol: Protocol) -> float:
    """The area under the ROC curve of one doubter, all folds and left-out classes together."""
    return _area(_asked(doubter, folds(protocol, labels, actors), labels))


def nested_unknown_auc(doubters: Sequence[Doubter], labels: Indices, actors: Indices, protocol: Protocol) -> float:
    """The same where for each actor and each left-out class the doubter is chosen by all others.

    The choice runs the protocol with the other actors and the other classes alone.

    Raises:
        MotiondeckError: if there are too few actors or classes for that.
    """
    if len(np.unique(labels)) < FEWEST_CLASSES:
        raise MotiondeckError("leaving a class out, and another one for the choice, takes four classes or more")
    seen: list[tuple[Array, Array]] = []
    for learn, ask in folds(protocol, labels, actors):
        one = actors[learn] if protocol == "one-actor" else actors[ask]
        for left_out in np.unique(labels[ask]):
            others = np.flatnonzero((actors != one[0]) & (labels != left_out))
            inner = [(others[a], others[b]) for a, b in folds(protocol, labels[others], actors[others])]
            best = max(doubters, key=lambda doubter: _area(_asked(doubter, inner, labels)))
            seen.append(_told(best, learn, ask, labels, left_out))
    return _area(seen)


def _asked(doubter: Doubter, splits: Sequence[Fold], labels: Indices) -> list[tuple[Array, Array]]:
    return [
        _told(doubter, learn, ask, labels, left_out) for learn, ask in splits for left_out in np.unique(labels[ask])
    ]


def _told(doubter: Doubter, learn: Indices, ask: Indices, labels: Indices, left_out: int) -> tuple[Array, Array]:
    """The confidence in known and in unknown examples."""
    confidence = doubter.confidence(learn[labels[learn] != left_out], ask)
    known = labels[ask] != left_out
    return confidence[known], confidence[~known]


def _area(seen: Iterable[tuple[Array, Array]]) -> float:
    known, unknown = zip(*seen, strict=True)
    return area_under_curve(np.concatenate(known), np.concatenate(unknown))


def area_under_curve(high: Array, low: Array) -> float:
    """The share of pairs in which a number of `high` exceeds one of `low`; ties count half (Mann-Whitney)."""
    ranks = rankdata(np.concatenate([high, low]))
    return float((ranks[: len(high)].sum() - len(high) * (len(high) + 1) / 2.0) / (len(high) * len(low)))
