"""Measures methods in the same folds: accuracy, confusion, nested choice, time warp, dimensions."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from benchmarks.recognition.methods import Method, Prepare, Scorer, shared_experts
from benchmarks.recognition.reduction import REDUCTIONS, Reduce
from controller.learning.recognition.experts import ExpertRecipe
from controller.learning.recognition.features import FeatureRecipe, features, with_velocity
from controller.learning.recognition.labelled_recordings import Dataset, Fold, Protocol, folds, inner_folds
from controller.motion.rotations import Array, Indices

WARPS = (0.5, 0.7, 0.85, 1.0, 1.2, 1.4, 2.0)
STRETCHES = (0.7, 1.0, 1.4)
DIMENSIONS = (2, 3, 5, 10, 15, 20, 30, 42)


class Result(msgspec.Struct, frozen=True, kw_only=True):
    """How a method did under a protocol.

    Attributes:
        method, protocol: their names.
        accuracy: the share of asked examples that were named rightly, mean over seeds.
        spread: its standard deviation over seeds.
        per_class: the share within each class.
        confusion: row = what it was, column = what it was taken for; counts over all folds and seeds.
        by_fold: the accuracy in each fold for each seed.
        seconds: for preparing and scoring all folds of one seed, features not counted.
    """

    method: str
    protocol: str
    accuracy: float
    spread: float
    per_class: dict[str, float]
    confusion: list[list[int]]
    by_fold: list[list[float]]
    seconds: float


Seeded = Callable[[int], Sequence[Method]]  # a seed -> the method, or candidates among which each fold chooses


def measure(name: str, candidates: Seeded, dataset: Dataset, protocol: Protocol, seeds: Sequence[int]) -> Result:
    """Asks a method under a protocol.

    Where there are several candidates, each fold chooses among them by what it has learned alone (nested choice).
    """
    classes, labels = dataset.classes, dataset.labels
    shares: list[float] = []
    by_fold: list[list[float]] = []
    confusion = np.zeros((len(classes), len(classes)), dtype=np.int64)
    seconds = 0.0
    for seed in seeds:
        methods = candidates(seed)
        signals = [[method.look(example, 1.0) for example in dataset.examples] for method in methods]
        start = time.perf_counter()
        scorers = [m.prepare(s, labels, len(classes)) for m, s in zip(methods, signals, strict=True)]
        own = np.zeros_like(confusion)
        by_fold.append([])
        for learn, ask in folds(protocol, labels, dataset.actors, seed):
            score = chosen(scorers, learn, labels, dataset.actors, seed)
            named = score(learn, ask).argmin(1)
            np.add.at(own, (labels[ask], named), 1)
            by_fold[-1].append(float((named == labels[ask]).mean()))
        seconds += time.perf_counter() - start
        shares.append(float(np.trace(own)) / int(own.sum()))
        confusion += own
    asked = confusion.sum(1)
    return Result(
        method=name,
        protocol=protocol,
        accuracy=float(np.mean(shares)),
        spread=float(np.std(shares)),
        per_class={c: float(confusion[i, i] / asked[i]) for i, c in enumerate(classes) if asked[i]},
        confusion=confusion.tolist(),
        by_fold=by_fold,
        seconds=seconds / len(seeds),
    )


def chosen(scorers: Sequence[Scorer], learn: Indices, labels: Indices, actors: Indices, seed: int) -> Scorer:
    """The scorer that does best on splits of the learned examples themselves.

    Equal accuracy is decided by the mean log probability of the right class, taking costs for negative log odds.
    """
    if len(scorers) == 1:
        return scorers[0]
    splits: list[Fold] = [
        (learn[inner], learn[asked]) for inner, asked in inner_folds(labels[learn], actors[learn], seed)
    ]
    return max(scorers, key=lambda score: _merit(score, splits, labels))


def _merit(score: Scorer, splits: list[Fold], labels: Indices) -> tuple[float, float]:
    right: list[Array] = []
    sure: list[Array] = []
    for learn, ask in splits:
        costs = score(learn, ask)
        own = costs[np.arange(len(ask)), labels[ask]]
        right.append((costs.argmin(1) == labels[ask]).astype(np.float64))
        sure.append(-np.log(np.exp(own[:, None] - costs).sum(1)))
    return float(np.concatenate(right).mean()), float(np.concatenate(sure).mean())


class Point(msgspec.Struct, frozen=True, kw_only=True):
    """One point of a curve: x and the accuracy there."""

    x: float
    accuracy: float


def warp_curve(
    method: Method,
    dataset: Dataset,
    protocol: Protocol,
    warps: Sequence[float] = WARPS,
    taught: Sequence[float] = (1.0,),
) -> list[Point]:
    """Accuracy when motions are asked at `x` times their duration, and learned at each of `taught` times it."""
    labels, classes = dataset.labels, len(dataset.classes)
    count, copies = len(labels), len(taught)
    learned = [method.look(example, stretch) for stretch in taught for example in dataset.examples]
    every = np.tile(labels, copies + 1)
    out: list[Point] = []
    for warp in warps:
        asked = [method.look(example, warp) for example in dataset.examples]
        # Each example is there at each stretch, for learning, and warped, for testing.
        score = method.prepare(learned + asked, every, classes)
        right = [
            score(np.concatenate([learn + copy * count for copy in range(copies)]), ask + copies * count).argmin(1)
            == labels[ask]
            for learn, ask in folds(protocol, labels, dataset.actors)
        ]
        out.append(Point(x=warp, accuracy=float(np.concatenate(right).mean())))
    return out


def reduced(prepare: Prepare, reduce: Reduce, keep: int, rate: float) -> Prepare:
    """A method on fewer dimensions of its signals and their velocities; what to keep is learned fold by fold."""

    def prepared(signals: list[Array], labels: Indices, classes: int) -> Scorer:
        def score(learn: Indices, ask: Indices) -> Array:
            matrix = reduce(np.concatenate([signals[i] for i in learn]), keep)
            fewer = [with_velocity(signal @ matrix, rate) for signal in signals]
            return prepare(fewer, labels, classes)(learn, ask)

        return score

    return prepared


def dimension_curves(
    dataset: Dataset, protocol: Protocol, experts: ExpertRecipe, dimensions: Sequence[int] = DIMENSIONS
) -> dict[str, list[Point]]:
    """Accuracy of the experts on fewer and fewer dimensions of the joint positions, for each way to reduce them."""
    look = FeatureRecipe(velocity=False)
    signals = [features(example.clip, look) for example in dataset.examples]
    labels, classes = dataset.labels, len(dataset.classes)
    curves: dict[str, list[Point]] = {}
    for name, reduce in REDUCTIONS.items():
        curves[name] = []
        for keep in dimensions:
            if keep > signals[0].shape[1]:
                continue
            score = reduced(shared_experts(experts), reduce, keep, look.rate)(signals, labels, classes)
            right = [
                score(learn, ask).argmin(1) == labels[ask] for learn, ask in folds(protocol, labels, dataset.actors)
            ]
            curves[name].append(Point(x=keep, accuracy=float(np.concatenate(right).mean())))
    return curves
