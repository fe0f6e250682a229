"""A bank of experts: the moments of each class, and the classification of motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from controller.learning.recognition.experts import (
    ExpertRecipe,
    Forced,
    Moments,
    centre,
    expert_reservoir,
    force,
    group_readouts,
    log_errors,
    moments,
    total,
)
from controller.motion.rotations import Array
from controller.networks.reservoirs.reservoir import Reservoir


@dataclass(frozen=True, eq=False)
class ExpertBank:
    """M experts that share a reservoir of N neurons."""

    recipe: ExpertRecipe
    reservoir: Reservoir
    classes: tuple[str, ...]  # names of the motions, length M
    moments: tuple[Moments, ...]  # of each class's training motions

    @cached_property
    def readouts(self) -> Array:
        """The readouts of each expert, by groups of neurons, shape (M, G, C, N / G)."""
        return np.array([group_readouts(of, self.recipe) for of in self.moments])

    @property
    def together(self) -> int:
        """Number of adjacent channels with a common error."""
        return self.recipe.together(len(self.moments[0].yy))

    @cached_property
    def centre(self) -> Array:
        """The mean log error of each expert over all classes, shape (M,); see `experts.centre`."""
        return centre(self.readouts, self.moments, self.together)

    def force(self, signals: list[Array]) -> list[Forced]:
        """Signals (T_j, C) forced through the reservoir."""
        return force(self.reservoir, signals, self.recipe.washout)

    def costs(self, signals: list[Array]) -> Array:
        """The centred log error of each expert on each signal, shape (signals, M); the least names the class."""
        return log_errors(self.readouts, self.force(signals), self.together) - self.centre

    def confidences(self, costs: Array) -> Array:
        """The confidence of verdicts on costs (signals, M), shape (signals,), for comparison with the threshold."""
        return margins(costs) - self.recipe.doubt * costs.min(1)

    def learned(self, label: str, signals: list[Array]) -> ExpertBank:
        """The bank with more motions of a class, known or new; the readouts of other classes stay."""
        more = total(moments(forced) for forced in self.force(signals))
        known = dict(zip(self.classes, self.moments, strict=True))
        known[label] = known[label] + more if label in known else more
        return ExpertBank(self.recipe, self.reservoir, tuple(known), tuple(known.values()))


def teach(recipe: ExpertRecipe, signals: list[Array], labels: Sequence[str]) -> ExpertBank:
    """A bank trained on labelled signals (T_j, C); its classes are in alphabetical order."""
    reservoir = expert_reservoir(recipe, signals[0].shape[1])
    forced = force(reservoir, signals, recipe.washout)
    classes = tuple(sorted(set(labels)))
    of = [total(moments(f) for f, label in zip(forced, labels, strict=True) if label == name) for name in classes]
    return ExpertBank(recipe, reservoir, classes, tuple(of))


def margins(costs: Array) -> Array:
    """The difference between the second-least and the least cost, shape (signals,)."""
    if costs.shape[1] < 2:
        return np.zeros(len(costs))
    two = np.partition(costs, 1, axis=1)[:, :2]
    return two[:, 1] - two[:, 0]
