"""Hides a joint for a while in each part of a recording, has it filled in, and says how far off that is."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from controller.rotations import Array
from controller.training.reconstruction import fill_missing

# What must be seen before and after a gap, s, and how much of it a cubic is laid through.
SEEN_S, NEAR_S = 0.5, 0.25


def fill_hidden(parts: list[Array], joint: int, rate: float, gap_s: float) -> tuple[float, float, float] | None:
    """Mean absolute errors of a coordinate in the gap: by the other joints' network, by a line, by a cubic.

    Args:
        parts: joints of each part, shape (K, M, 3); too short ones are left out, None if all are.
        joint: which one is hidden, in the middle of each part.
        rate: frames per second.
        gap_s: for how long.
    """
    gap, seen, near = round(gap_s * rate), round(SEEN_S * rate), max(2, round(NEAR_S * rate))
    missed: list[tuple[float, float, float]] = []
    for part in parts:
        if len(part) < gap + 2 * seen:
            continue
        first = (len(part) - gap) // 2
        inside = np.arange(first, first + gap)
        outside = np.concatenate([np.arange(first - near, first), np.arange(first + gap, first + gap + near)])
        truth = part[inside, joint]
        hidden = part.copy()
        hidden[inside, joint] = np.nan
        by_network = fill_missing(hidden, rate)[inside, joint]
        edges = [first - 1, first + gap]
        by_line = np.stack([np.interp(inside, edges, part[edges, joint, axis]) for axis in range(3)], axis=-1)
        by_cubic = CubicSpline(outside, part[outside, joint])(inside)
        network, line, cubic = (float(np.abs(said - truth).mean()) for said in (by_network, by_line, by_cubic))
        missed.append((network, line, cubic))
    if not missed:
        return None
    network, line, cubic = np.mean(missed, axis=0).tolist()
    return network, line, cubic
