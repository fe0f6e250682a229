"""A committee within one reservoir: groups of its neurons predict separately, and are judged joint by joint.

The neurons of a reservoir are split into groups, and each class has a readout from each group. An expert's cost is the
mean over groups and joints of the logarithm of its squared error, less its mean over all classes:

    e_m = mean over groups g and joints j of log( mean over t of |y_j(t) - W_mg x_g(t)|_j^2 )

One group's chance errors are averaged out, and a joint that hardly moves counts as much as one that swings. That tells
known motions from unknown ones better than the error of all joints together does; see docs/recognition.md.
"""

from __future__ import annotations

import numpy as np

from benchmarks.recognition.methods import Prepare, Scorer, learned_by_class
from controller.learning.recognition.experts import (
    SMALLEST_ERROR,
    ExpertRecipe,
    ModelSpace,
    Moments,
    expert_reservoir,
    force,
    moments,
    readout,
    total,
)
from controller.motion.rotations import Array, Indices

NEURONS, GROUPS = 200, 8
A_JOINT = 3  # channels: a position, or a velocity


def committee(recipe: ExpertRecipe, groups: int = GROUPS, together: int | None = A_JOINT) -> Prepare:
    """Experts that are committees.

    Args:
        recipe: of the reservoir that all share; what is left over when its neurons are split is not used.
        groups: into how many its neurons are split.
        together: how many neighbouring channels are judged together; all of them if None.
    """

    def prepare(signals: list[Array], labels: Indices, classes: int) -> Scorer:
        judge = _Judge(recipe, groups, together, signals)

        def score(learn: Indices, ask: Indices) -> Array:
            own = learned_by_class(learn, labels, classes)
            learned = [label for label in range(classes) if len(own[label])]
            errors = np.column_stack([judge.log_errors(own[label]) for label in learned])
            centre = np.mean([errors[own[label]].mean(0) for label in learned], axis=0)
            costs = np.full((len(ask), classes), np.inf)
            costs[:, learned] = errors[ask] - centre
            return costs

        return score

    return prepare


def with_model_space(recipe: ExpertRecipe) -> Prepare:
    """A committee whose costs are lowered by the votes of the clips' own readouts, as a recognizer's are."""

    def prepare(signals: list[Array], labels: Indices, classes: int) -> Scorer:
        experts = committee(recipe, recipe.groups)(signals, labels, classes)
        reservoir = expert_reservoir(recipe, signals[0].shape[1])
        clips = [moments(one) for one in force(reservoir, signals, recipe.washout)]

        def score(learn: Indices, ask: Indices) -> Array:
            costs, own = experts(learn, ask), experts(learn, learn)
            learned = np.unique(labels[learn])
            numbers = np.searchsorted(learned, labels[learn])
            space = ModelSpace.fit([clips[i] for i in learn], numbers.tolist(), own[:, learned], recipe)
            costs[:, learned] -= space.votes([clips[i] for i in ask], recipe)
            return costs

        return score

    return prepare


class _Judge:
    """Knows how well an expert taught with some of the signals predicts all of them."""

    def __init__(self, recipe: ExpertRecipe, groups: int, together: int | None, signals: list[Array]) -> None:
        channels = signals[0].shape[1]
        forced = force(expert_reservoir(recipe, channels), signals, recipe.washout)
        self._of = [moments(one) for one in forced]
        self._states = np.concatenate([one.states for one in forced])
        self._targets = np.concatenate([one.targets for one in forced])
        self._frames = np.array([len(one.targets) for one in forced])
        size = recipe.neurons // groups
        self._groups = [slice(size * number, size * (number + 1)) for number in range(groups)]
        self._together = together if together and channels % together == 0 else channels
        self._ridge = recipe.ridge
        self._known: dict[bytes, Array] = {}

    def log_errors(self, own: Indices) -> Array:
        """The mean log error, over groups and joints, on each signal of the expert taught with `own`, shape (n,)."""
        key = own.tobytes()
        if key not in self._known:
            taught = total(self._of[i] for i in own)
            self._known[key] = np.mean([self._of_group(taught, group) for group in self._groups], axis=0)
        return self._known[key]

    def _of_group(self, taught: Moments, group: slice) -> Array:
        weights = readout(Moments(taught.xx[group, group], taught.xy[group], taught.yy, taught.count), self._ridge)
        square = np.square(self._states[:, group] @ weights.T - self._targets)
        starts = np.concatenate([[0], np.cumsum(self._frames)[:-1]])
        means = np.add.reduceat(square, starts, axis=0) / self._frames[:, None]
        joints = means.reshape(len(means), -1, self._together).mean(2)
        return np.log(np.maximum(joints, SMALLEST_ERROR)).mean(1)
