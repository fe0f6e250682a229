"""Motion strings on a self-organising map, aligned locally (after Wu, Xia, Wang and Li 2009).

A map of poses is learned from single frames; a motion becomes the string of map nodes it passes through; two strings
are as alike as their best local alignment (Smith-Waterman). The class is that of the most similar learned motion. The
map is learned from the learned motions only.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from benchmarks.recognition.alignment import locally_aligned
from benchmarks.recognition.methods import Prepare, Scorer
from controller.motion.rotations import Array, Indices

ROUNDS = 15
GAP = 0.5


def pose_map(frames: Array, side: int) -> Array:
    """The nodes of a batch self-organising map of side x side, shape (side^2, C).

    It starts spread over the two main axes of the frames; the neighbourhood shrinks from half the side to one node.
    """
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), axis=-1).reshape(-1, 2)
    mean = frames.mean(0)
    _, strength, axes = np.linalg.svd(frames - mean, full_matrices=False)
    spread = 2.0 * (grid / (side - 1) - 0.5) * strength[:2] / np.sqrt(len(frames))
    nodes = mean + 1.5 * spread @ axes[:2]
    between = np.square(cdist(grid, grid))
    for width in np.geomspace(side / 2.0, 0.7, ROUNDS):
        winner = cdist(frames, nodes).argmin(1)
        pull = np.exp(-between / (2.0 * width**2))[:, winner]
        nodes = (pull @ frames) / np.maximum(pull.sum(1, keepdims=True), 1e-12)
    return nodes


def motion_strings(side: int = 8) -> Prepare:
    """1-NN by local alignment of motion strings; frames should be sparse (some 10 Hz)."""

    def prepare(signals: list[Array], labels: Indices, classes: int) -> Scorer:
        lengths = np.array([len(signal) for signal in signals])

        def score(learn: Indices, ask: Indices) -> Array:
            nodes = pose_map(np.concatenate([signals[i] for i in learn]), side)
            distance = cdist(nodes, nodes)
            near = float(np.median(np.sort(distance, axis=1)[:, 4]))  # how far the four neighbours of a node are
            likeness = np.maximum(1.0 - distance / (2.0 * near), -1.0)
            strings = [cdist(signal, nodes).argmin(1) for signal in signals]
            learned = np.zeros((len(learn), int(lengths[learn].max())), dtype=np.int64)
            inside = np.arange(learned.shape[1]) < lengths[learn][:, None]
            learned[inside] = np.concatenate([strings[i] for i in learn])
            costs = np.full((len(ask), classes), np.inf)
            for row, i in enumerate(ask):
                pairs = likeness[strings[i]][:, learned].transpose(1, 0, 2)
                pairs = np.where(inside[:, None, :], pairs, -1e3)
                best = locally_aligned(pairs, GAP).max((1, 2)) / np.minimum(lengths[i], lengths[learn])
                for label in np.unique(labels[learn]):
                    costs[row, label] = -best[labels[learn] == label].max()
            return costs

        return score

    return prepare
