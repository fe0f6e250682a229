"""The centralized network of one segment, trained with the settings of the published figures."""

from __future__ import annotations

import numpy as np

from controller.learning.centralized.satellite_learning import learn, ridge_readout, slow_and_fast
from controller.motion.rotations import Array

TRIES = 30
KEPT = 4
ITERATIONS = 500


def play_segment(segment: Array, rate: float, satellites: int, centers: int = 2) -> Array:
    """Joints or markers (K, M, 3) as learned satellites play them; each coordinate's mean is kept beside.

    Args:
        segment: K frames.
        rate: frames per second.
        satellites: m; fewer where there are not as many frames.
        centers: n.
    """
    flat = segment.reshape(len(segment), -1)
    middle = flat.mean(0)
    time = np.arange(len(flat)) / rate
    starts = slow_and_fast(len(flat) / rate, centers, TRIES, 0)
    learned = learn(flat - middle, time, min(satellites, len(flat) - 1), starts, keep=KEPT, iterations=ITERATIONS)
    response = learned.respond(time)
    return (response @ ridge_readout(response, flat - middle).T + middle).reshape(segment.shape)
