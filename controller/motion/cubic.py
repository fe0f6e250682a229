"""The cubic between frames (Catmull-Rom): from p1 to p2 with the slopes (p2 - p0) / 2 and (p3 - p1) / 2."""

import numpy as np

from controller.motion.rotations import Array

CUBIC: Array = 0.5 * np.array([[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]], dtype=np.float64)
"""Rows: the weights of p0 .. p3 for 1, u, u^2, u^3, with u in [0, 1] from p1 to p2."""


def between_frames(frames: Array, at: Array) -> Array:
    """Frames (T, channels) interpolated at times (S,), counted in frames; constant beyond both ends."""
    low = np.floor(at)
    near = (low[:, None] + np.arange(-1.0, 3.0)).clip(0, len(frames) - 1).astype(np.int64)
    weights = (at - low)[:, None] ** np.arange(4.0) @ CUBIC
    return np.matmul(weights[:, None], frames[near])[:, 0]
