"""Chooses the numbers of centers and satellites by Akaike's criterion (Vakulenko et al. 2017, fig. 13)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from controller.learning.centralized.model_choice import aicc
from controller.learning.centralized.motion_training import RATE, train_centralized
from controller.motion.rotations import Array
from controller.networks.centralized.centralized import CentralizedMotion
from motiondeck_base.errors import MotiondeckError

CENTERS = (1, 2, 3)
SATELLITES = (9, 16, 25, 36, 49, 64, 81, 100)

ITERATIONS = 15  # of the refinement of compared networks


@dataclass(frozen=True)
class Scored:
    """One choice of sizes."""

    centers: int  # n
    satellites: int  # m
    aicc: float  # at RATE; the least is best
    error: float  # root mean square error over the standard deviation of the channels
    motion: CentralizedMotion


def score_models(
    channels: Array,
    rate: float,
    *,
    loop: bool,
    centers: Iterable[int] = CENTERS,
    satellites: Iterable[int] = SATELLITES,
    iterations: int = ITERATIONS,
    seed: int = 0,
) -> list[Scored]:
    """Every choice of sizes with enough frames for a motion (K, D), the best first.

    Raises:
        MotiondeckError: if there is none.
    """
    stride = max(1, round(rate / RATE))
    seen = channels[::stride]
    time = np.arange(len(seen)) * stride / rate
    spread = np.maximum(channels.std(0), 1e-3 * max(1e-12, float(channels.std(0).max())))
    sizes = list(satellites)
    scored = []
    for n in centers:
        for m in sizes:
            if m > len(channels) // 3 or m >= len(seen):
                continue
            try:
                motion = train_centralized(
                    channels, rate, loop=loop, centers=n, satellites=m, iterations=iterations, seed=seed
                )
            except MotiondeckError:
                continue  # its weights grow too large: too many satellites
            missed = float(np.square((motion.at(time) - seen) / spread).sum())
            parameters = (m + 1) * channels.shape[1] + m * (2 * n + 1) + 2 * n
            criterion = aicc(missed, seen.size, parameters)
            if not np.isfinite(criterion):
                continue
            scored.append(Scored(n, m, criterion, float(np.sqrt(missed / seen.size)), motion))
    if not scored:
        raise MotiondeckError(f"{len(channels)} frames are too few to choose a network by")
    return sorted(scored, key=lambda one: one.aicc)
