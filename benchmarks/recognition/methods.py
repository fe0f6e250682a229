"""The interface of a recognition method in the benchmark, and the echo-state experts: the proposal's and ours.

A method is prepared once with all signals, without their labels' help (it may drive a reservoir, or measure distances),
and is then asked fold by fold: it learns some of them and says how badly others fit each class.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from benchmarks.recognition.recorded_angles import recorded_angles
from controller.learning.recognition.experts import (
    SMALLEST_ERROR,
    ExpertRecipe,
    Forced,
    centre,
    expert_reservoir,
    force,
    moments,
    readout,
    total,
)
from controller.learning.recognition.features import FeatureRecipe, features, resampled
from controller.learning.recognition.labelled_recordings import Example
from controller.motion.rotations import Array, Indices
from controller.networks.reservoirs.reservoir import random_reservoir

# (learn, ask) -> the cost of each class for each asked example, shape (len(ask), classes); least is nearest.
Scorer: TypeAlias = Callable[[Indices, Indices], Array]
Look: TypeAlias = Callable[[Example, float], Array]  # an example, stretched in time by a factor, as a signal (T, C)
Prepare: TypeAlias = Callable[[list[Array], Indices, int], Scorer]  # signals, labels, how many classes


@dataclass(frozen=True)
class Method:
    """A way to recognize.

    Attributes:
        name: in the table.
        look: what it sees of an example.
        prepare: makes a scorer of all signals and labels.
    """

    name: str
    look: Look
    prepare: Prepare


def looking_at(recipe: FeatureRecipe) -> Look:
    """A look at the features of a recipe."""
    return lambda example, stretch: features(example.clip, recipe, stretch)


def at_recorded_angles(example: Example, stretch: float) -> Array:
    """What the proposal looks at: the 59 angles as they stand in the file, at the rate of the recording."""
    angles = recorded_angles(example.path)
    return angles if stretch == 1.0 else resampled(angles, 1.0, stretch)


def learned_by_class(learn: Indices, labels: Indices, classes: int) -> list[Indices]:
    """Which learned examples belong to each class."""
    return [learn[labels[learn] == label] for label in range(classes)]


def shared_experts(recipe: ExpertRecipe, *, centred: bool = True) -> Prepare:
    """Experts that share one reservoir (see `experts`), judged by raw or centred log error."""

    def prepare(signals: list[Array], labels: Indices, classes: int) -> Scorer:
        reservoir = expert_reservoir(recipe, signals[0].shape[1])
        return forced_scorer(force(reservoir, signals, recipe.washout), labels, classes, recipe.ridge, centred)

    return prepare


def forced_scorer(forced: list[Forced], labels: Indices, classes: int, ridge: float, centred: bool) -> Scorer:
    """Ridge experts on whatever states go with each frame; classes that were not learned cost infinity."""
    of = [moments(f) for f in forced]

    def score(learn: Indices, ask: Indices) -> Array:
        groups = learned_by_class(learn, labels, classes)
        learned = [label for label in range(classes) if len(groups[label])]
        parts = [total(of[i] for i in groups[label]) for label in learned]
        readouts = np.array([readout(part, ridge) for part in parts])
        costs = np.full((len(ask), classes), np.inf)
        costs[:, learned] = np.log(np.maximum(mean_errors(readouts, [forced[i] for i in ask]), SMALLEST_ERROR))
        if centred:
            costs[:, learned] -= centre(readouts[:, None], parts, readouts.shape[1])
        return costs

    return score


def mean_errors(readouts: Array, forced: list[Forced]) -> Array:
    """The mean squared error of each expert on each motion, shape (motions, M), all motions in one product."""
    experts, channels, neurons = readouts.shape
    lengths = np.array([len(f.states) for f in forced])
    guess = np.concatenate([f.states for f in forced]) @ readouts.reshape(-1, neurons).T
    guess = guess.reshape(-1, experts, channels)
    guess -= np.concatenate([f.targets for f in forced])[:, None]
    square = np.einsum("tmc,tmc->tm", guess, guess) / channels
    starts = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    return np.add.reduceat(square, starts, axis=0) / lengths[:, None]


PROPOSED_WASHOUT = 20
PROPOSED_RADIUS = 0.8


def proposal(neurons: int, seed: int = 1) -> Prepare:
    """The proposal to the letter: a reservoir of its own for each class, pseudoinverse, smallest error."""

    def prepare(signals: list[Array], labels: Indices, classes: int) -> Scorer:
        channels = signals[0].shape[1]
        banks = [
            force(
                random_reservoir(
                    neurons,
                    channels,
                    spectral_radius=PROPOSED_RADIUS,
                    input_scale=0.5 * float(np.sqrt(3.0 / channels)),
                    bias_scale=0.0,
                    rng=np.random.default_rng([seed, label]),
                ),
                signals,
                PROPOSED_WASHOUT,
            )
            for label in range(classes)
        ]

        def score(learn: Indices, ask: Indices) -> Array:
            costs = np.full((len(ask), classes), np.inf)
            for label, own in enumerate(learned_by_class(learn, labels, classes)):
                if len(own):
                    forced = banks[label]
                    states = np.concatenate([forced[i].states for i in own])
                    weights = np.linalg.pinv(states) @ np.concatenate([forced[i].targets for i in own])
                    costs[:, label] = mean_errors(weights.T[None], [forced[i] for i in ask])[:, 0]
            return costs

        return score

    return prepare
