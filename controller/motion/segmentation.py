"""Where one motion of a recording ends and the next begins: by hand, by labels, or found.

What is found follows J. Barbic et al., "Segmenting motion capture data into distinct behaviors" (Graphics Interface
2004): a simple motion stays near a plane of few dimensions, and a border is where that plane changes. Where they walk
on greedily, here the borders with the least total residual are computed exactly, by dynamic programming.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from controller.motion.clip import Clip
from controller.motion.rotations import Array, conjugate, multiply, rotate, yaw
from motiondeck_base.errors import FileFormatError

RATE = 10.0
PLANE = 4
SHORTEST_SECONDS = 1.0
REDUCED = 16

# A further border has to remove this share of the residual of the undivided recording.
WORTH = 0.03
MOST_SEGMENTS = 40

Bounds = tuple[tuple[int, int], ...]


def by_hand(borders: list[int], frames: int) -> Bounds:
    """Segments (first frame, end) between borders.

    Raises:
        FileFormatError: if the borders do not rise, or lie outside the recording.
    """
    ends = [0, *borders, frames]
    for first, end in pairwise(ends):
        if first >= end:
            raise FileFormatError(f"segment {first} to {end}: borders must rise between 0 and {frames} frames")
    return tuple(pairwise(ends))


def body_features(clip: Clip) -> Array:
    """Joints relative to the root and seen from its heading, and their rates over 0.1 s, shape (T, 6 B), m."""
    forward = rotate(clip.rotation[:, 0], np.array([1.0, 0.0, 0.0]))
    heading = np.arctan2(forward[:, 1], forward[:, 0])
    turned = multiply(conjugate(yaw(heading))[:, None, :], clip.rotation)
    root = np.zeros((len(clip), 3))
    root[:, 2] = clip.root_position[:, 2]
    places = clip.skeleton.joints(root, turned).reshape(len(clip), -1)
    return np.concatenate([places, 0.1 * clip.rate * np.asarray(np.gradient(places, axis=0))], axis=1)


def find_segments(features: Array, rate: float, count: int | None = None, plane: int = PLANE) -> Bounds:
    """The segments of a recording that lie nearest to planes of few dimensions, each to its own.

    Args:
        features: of each frame, shape (T, F); `body_features`, or any channels of the same unit.
        rate: frames per second.
        count: how many segments; None adds borders as long as they are worth it (WORTH).
        plane: how many dimensions a simple motion has.

    Raises:
        FileFormatError: if the recording is too short for that many segments of a second each.
    """
    stride = max(1, round(rate / RATE))
    seen = features[::stride]
    shortest = max(plane + 1, round(SHORTEST_SECONDS * rate / stride))
    possible = len(seen) // shortest
    wanted = 1 if count is None else count
    if not 1 <= wanted <= possible:
        raise FileFormatError(
            f"{len(features) / rate:.1f} s cannot be cut into {wanted} segments of a second or more each"
        )
    residual = _residuals(seen, plane, shortest)
    totals, before = _best_borders(residual, min(possible, count or MOST_SEGMENTS))
    if count is None:
        worth = WORTH * float(residual[0, -1])
        count = 1 + int(np.argmin(totals + worth * np.arange(0.0, len(totals))))
    borders, end = [], len(seen)
    for k in range(count - 1, 0, -1):
        end = int(before[k, end])
        borders.append(end * stride)
    return by_hand(borders[::-1], len(features))


def _residuals(seen: Array, plane: int, shortest: int) -> Array:
    """What the best plane leaves of frames i to j, shape (T + 1, T + 1); infinite where j - i is too short.

    It is measured in the REDUCED directions in which the whole recording moves most.
    """
    centred = seen - seen.mean(0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    reduced = centred @ axes[: max(plane + 1, REDUCED)].T
    frames, r = reduced.shape
    first = np.concatenate([np.zeros((1, r)), np.cumsum(reduced, axis=0)])
    second = np.concatenate([np.zeros((1, r, r)), np.cumsum(reduced[:, :, None] * reduced[:, None, :], axis=0)])
    out = np.full((frames + 1, frames + 1), np.inf)
    for i in range(frames - shortest + 1):
        ends = np.arange(i + shortest, frames + 1)
        total = first[ends] - first[i]
        scatter = second[ends] - second[i] - total[:, :, None] * total[:, None, :] / (ends - i)[:, None, None]
        out[i, ends] = np.linalg.eigvalsh(scatter)[:, : r - plane].sum(1)
    return out


def _best_borders(residual: Array, most: int) -> tuple[Array, NDArray[np.int64]]:
    """The least residual of 1 to `most` segments, and where the last of k segments that end at j begins."""
    frames = len(residual) - 1
    least = np.full((most, frames + 1), np.inf)
    before = np.zeros((most, frames + 1), dtype=np.int64)
    least[0] = residual[0]
    for k in range(1, most):
        through = least[k - 1][:, None] + residual
        before[k] = through.argmin(0)
        least[k] = through.min(0)
    return least[:, -1], before
