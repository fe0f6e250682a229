"""Experts for segmentation that are trained on the first occurrence of each behaviour in the same stream."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from benchmarks.recognition.segment_labels import Labels
from controller.learning.recognition.experts import ExpertBank, ExpertRecipe, teach
from controller.learning.recognition.features import FeatureRecipe
from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError

Frames = NDArray[np.int64]

SMOOTHING = 0.5  # s

# One person, few classes: single frames and the height of the root matter more than the memory of the reservoir.
LOOK = FeatureRecipe(velocity=False, height=True)
EXPERTS = ExpertRecipe(leak=1.0)


def smoothed(costs: Array, rate: float, seconds: float = SMOOTHING) -> Array:
    """The mean of costs (T, M) over a window around each frame."""
    return uniform_filter1d(costs, max(1, round(seconds * rate)), axis=0, mode="nearest")


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
