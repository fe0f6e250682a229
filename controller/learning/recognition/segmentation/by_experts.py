"""Segments a stream by recognition: the class of each frame by Viterbi decoding of the experts' errors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from controller.learning.recognition.expert_bank import ExpertBank, teach
from controller.learning.recognition.experts import SMALLEST_ERROR, ExpertRecipe, frame_errors
from controller.learning.recognition.features import FeatureRecipe
from controller.learning.recognition.segmentation.labels import Labels
from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError

Frames = NDArray[np.int64]

# Cost of a change of class, in seconds of an expert with e times the error.
CHANGE_COST = 0.67
SMOOTHING = 0.5  # s

# One person, few classes: single frames and the height of the root matter more than the memory of the reservoir.
LOOK = FeatureRecipe(velocity=False, height=True)
EXPERTS = ExpertRecipe(leak=1.0)


def frame_costs(bank: ExpertBank, signal: Array, *, centred: bool = True) -> Array:
    """The log error of each expert on each frame of a stream, shape (T, M); the first frame repeats the second's."""
    forced = bank.force([signal])[0]
    costs = np.log(np.maximum(frame_errors(bank.readouts, forced, bank.together), SMALLEST_ERROR)).mean(-1)
    costs = np.concatenate([np.repeat(costs[:1], len(signal) - len(costs), axis=0), costs])
    return costs - bank.centre if centred else costs


def smoothed(costs: Array, rate: float, seconds: float = SMOOTHING) -> Array:
    """The mean of costs (T, M) over a window around each frame."""
    return uniform_filter1d(costs, max(1, round(seconds * rate)), axis=0, mode="nearest")


def viterbi(costs: Array, change: float) -> Frames:
    """The sequence of classes, shape (T,), that minimises the sum of its costs (T, M) plus `change` for each change."""
    frames, classes = costs.shape
    came_from = np.zeros((frames, classes), dtype=np.int64)
    best = costs[0].copy()
    for t in range(1, frames):
        cheapest = int(best.argmin())
        switch = best[cheapest] + change < best
        came_from[t] = np.where(switch, cheapest, np.arange(classes))
        best = np.where(switch, best[cheapest] + change, best) + costs[t]
    path = np.empty(frames, dtype=np.int64)
    path[-1] = best.argmin()
    for t in range(frames - 1, 0, -1):
        path[t - 1] = came_from[t, path[t]]
    return path


def borders_of(path: Frames) -> Frames:
    """Where a sequence of classes changes: the first frame of each new one."""
    return np.flatnonzero(np.diff(path)) + 1


def first_occurrences(labels: Labels, stride: float) -> NDArray[np.bool_]:
    """The training frames (of every `stride`-th): the first segment of each class, or half of its only one."""
    best = [0, *labels.borders[:, 1].tolist(), labels.frames]
    count = int(np.ceil(labels.frames / stride))
    learn = np.zeros(count, dtype=np.bool_)
    for name in labels.classes:
        own = [s for s, other in enumerate(labels.names) if other == name]
        start, end = best[own[0]], best[own[0] + 1]
        if len(own) == 1:
            end = (start + end) // 2
        learn[int(np.ceil(start / stride)) : int(np.ceil(end / stride))] = True
    return learn


def not_learned(borders: Frames, labels: Labels) -> tuple[Frames, Frames]:
    """The borders for scoring experts of first occurrences: those with no training frames on either side.

    Args:
        borders: found ones, shape (n,), frames.
        labels: of the training.

    Returns:
        The borders found outside the training frames, and the earliest, best and latest frame of the marked ones.
    """
    learned = first_occurrences(labels, 1.0)
    marked = labels.borders
    fair = ~(learned[marked[:, 1] - 1] | learned[np.minimum(marked[:, 1], labels.frames - 1)])
    within = np.clip(borders, 1, labels.frames - 1)

    def near(marks: Frames) -> NDArray[np.bool_]:
        return np.any((borders[:, None] >= marks[:, 0]) & (borders[:, None] <= marks[:, 2]), axis=1)

    # Marks accept frames on both sides: a border just inside a training segment may belong to a mark that counts, and
    # one just outside to a mark that does not.
    outside = ~(learned[within - 1] | learned[within]) & ~near(marked[~fair])
    return borders[near(marked[fair]) | outside], marked[fair]


def bank_of_first_occurrences(
    signal: Array, labels: Labels, stride: float, recipe: ExpertRecipe = EXPERTS
) -> ExpertBank:
    """A bank trained on the first occurrences in a stream; its classes are in the order of `labels.classes`.

    Raises:
        MotiondeckError: if there is only one class, or one occurs too briefly to learn anything.
    """
    learn, of = first_occurrences(labels, stride)[: len(signal)], labels.of_frames(stride)[: len(signal)]
    if len(labels.classes) < 2:
        raise MotiondeckError("the labels hold only one class; there is nothing to tell apart")
    parts = [signal[: len(learn)][learn & (of == c)] for c in range(len(labels.classes))]
    for name, part in zip(labels.classes, parts, strict=True):
        if len(part) < 3:
            raise MotiondeckError(f"'{name}' first occurs for only {len(part)} frames; that is too short to learn from")
    numbered = [f"{c:04d}" for c in range(len(parts))]
    bank = teach(recipe, parts, numbered)
    return ExpertBank(bank.recipe, bank.reservoir, labels.classes, bank.moments)
