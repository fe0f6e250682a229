"""Segments a recording into motions by the planes that they stay near.

After J. Barbic et al., "Segmenting motion capture data into distinct behaviors" (Graphics Interface 2004): a simple
motion stays near a plane of few dimensions, and a border is where that plane changes. The borders with the least total
residual are computed exactly, by dynamic programming, instead of greedily.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from controller.motion.clip import Clip
from controller.motion.rotations import Array, conjugate, multiply, yaw
from motiondeck_base.errors import FileFormatError

RATE = 10.0  # Hz, of the frames compared
PLANE = 4
SHORTEST_SECONDS = 1.0
REDUCED = 16
WORTH = 0.03  # share of the residual of the undivided recording that a further border has to remove
MOST_SEGMENTS = 40

Bounds = tuple[tuple[int, int], ...]


def body_features(clip: Clip) -> Array:
    """Joints relative to the root in its heading frame, and their rates over 0.1 s, shape (T, 6 B), m."""
    heading = clip.heading()
    turned = multiply(conjugate(yaw(heading))[:, None, :], clip.rotation)
    root = np.zeros((len(clip), 3))
    root[:, 2] = clip.root_position[:, 2]
    places = clip.skeleton.joints(root, turned).reshape(len(clip), -1)
    return np.concatenate([places, 0.1 * clip.rate * np.asarray(np.gradient(places, axis=0))], axis=1)


def plane_segments(features: Array, rate: float, count: int | None = None, plane: int = PLANE) -> Bounds:
    """The segments (first frame, end) of a recording with the least residual from a plane each.

    Args:
        features: of each frame, shape (T, F); `body_features`, or any channels of the same unit.
        rate: frames per second, Hz.
        count: of segments; None adds borders by WORTH.
        plane: dimensions of a simple motion.

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
    borders: list[int] = []
    end = len(seen)
    for k in range(count - 1, 0, -1):
        end = int(before[k, end])
        borders.append(end * stride)
    return tuple(pairwise([0, *reversed(borders), len(features)]))


def _residuals(seen: Array, plane: int, shortest: int) -> Array:
    """The residual, in REDUCED principal directions, of the best plane for frames i to j; infinite if too short."""
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
    """The least residual of 1 to `most` segments, and the start of the last of k segments that end at j."""
    frames = len(residual) - 1
    least = np.full((most, frames + 1), np.inf)
    before = np.zeros((most, frames + 1), dtype=np.int64)
    least[0] = residual[0]
    for k in range(1, most):
        through = least[k - 1][:, None] + residual
        before[k] = through.argmin(0)
        least[k] = through.min(0)
    return least[:, -1], before
