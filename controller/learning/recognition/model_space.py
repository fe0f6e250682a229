"""Which class a clip's own readouts are like: ridge regression in the space of models.

A clip is represented by the readouts that predict it best, from the same states as the experts (reservoir model space:
Bianchi, Scardapane, Løkse and Jenssen, IEEE Trans. Neural Netw. Learn. Syst. 32, 2021). What separates the classes of
the training there is learned from all of them together, which experts, each of one class, do not do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller.learning.recognition.experts import ExpertRecipe, Moments, group_readouts
from controller.motion.rotations import Array

RIDGE = 0.1  # relative to the mean diagonal of the clips' Gram matrix


@dataclass(frozen=True, eq=False)
class ModelSpace:
    """A linear classifier of readouts with G C N / G = D numbers into M classes; its votes have the unit of a cost."""

    weights: Array  # shape (M, D)
    offset: Array  # shape (M,)

    def votes(self, clips: Sequence[Moments], recipe: ExpertRecipe) -> Array:
        """How like each class each clip is, less the mean over classes, shape (clips, M)."""
        return _points(clips, recipe) @ self.weights.T + self.offset


def fit_model_space(clips: Sequence[Moments], labels: Sequence[int], costs: Array, recipe: ExpertRecipe) -> ModelSpace:
    """The classifier of training clips with labels 0 to M - 1 and the experts' costs of them, shape (clips, M).

    Its votes on the training clips spread as far as the costs do, so both count alike.
    """
    points = _points(clips, recipe).astype(np.float32)  # 80 kB a clip and duration
    middle = points.mean(0)
    points -= middle
    gram = (points @ points.T).astype(np.float64)
    aims = np.eye(costs.shape[1])[list(labels)]
    aims -= aims.mean(0)
    aims -= aims.mean(1, keepdims=True)
    gain = np.linalg.solve(gram + np.eye(len(gram)) * max(RIDGE * float(np.trace(gram)) / len(gram), 1e-12), aims)
    gain *= (costs - costs.mean(1, keepdims=True)).std() / max(float((gram @ gain).std()), 1e-12)
    weights = (points.T @ gain).T.astype(np.float32)
    return ModelSpace(weights, -(weights @ middle.astype(np.float64)))


def _points(clips: Sequence[Moments], recipe: ExpertRecipe) -> Array:
    return np.array([group_readouts(of, recipe).ravel() for of in clips])
