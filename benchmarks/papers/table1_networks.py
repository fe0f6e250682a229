"""The networks of table 1 of Vakulenko et al. 2017: CMU 86 trial 1, four segments, two ways to place satellites.

The paper's method: q_i = sin(omega_i t) with omega_i of at least one turn a segment, Gaussian satellites that stay on a
grid, an exhaustive search over pairs of frequencies or a random one over triples, then a local refinement. Feet and
wrists are what remains of the paper's heels and wrists in an Acclaim recording; it does not say where its origin lies,
on which relative accuracies depend, so mm are given too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.papers.frequency_search import (
    Candidate,
    FrequencySearch,
    frequency_grid,
    readout,
    sines_at,
)
from controller.learning.centralized.model_choice import mean_absolute, relative_accuracy
from controller.learning.centralized.satellite_learning import learn, ridge_readout, slow_and_fast
from controller.motion.clip import Clip
from controller.motion.rotations import Array
from controller.networks.centralized.satellites import grid_places, spacing
from motiondeck_base.errors import FileFormatError

MARKERS = ("rfoot", "lfoot", "rwrist", "lwrist")
BORDERS = (0, 1300, 2000, 3000, 4500)

# Centers and satellites, and the integral relative accuracies that the paper gives for the four segments.
PAPER: dict[tuple[int, int], tuple[float, float, float, float]] = {
    (1, 100): (0.2133, 0.0827, 0.423, 0.0749),
    (2, 25): (0.1207, 0.0486, 0.0405, 0.076),
    (2, 50): (0.0351, 0.0089, 0.0084, 0.0586),
    (2, 100): (0.0189, 0.0068, 0.0029, 0.0299),
    (3, 25): (0.0832, 0.0253, 0.0297, 0.0685),
    (3, 100): (0.0133, 0.0063, 0.0031, 0.0071),
}

PAIRS_GRID = 80
RANDOM_TRIES = 2500
SHARPNESS_PER_SPACING = (0.35, 0.6, 1.0)


@dataclass(frozen=True)
class Entry:
    """One cell of the table.

    Attributes:
        centers, satellites, segment: which one; segments count from 1.
        paper, fixed, learned: integral relative accuracy (eq. 26, mean of the markers): the paper's figure, ours by its
            method, ours with learned satellites.
        fixed_mm, learned_mm: mean absolute error of a coordinate.
    """

    centers: int
    satellites: int
    segment: int
    paper: float
    fixed: float
    learned: float
    fixed_mm: float
    learned_mm: float


def centralized_table1(clip: Clip, iterations: int = 250) -> Iterator[Entry]:
    """The cells of the table, one after another; a few minutes for all.

    Args:
        clip: CMU 86 trial 1 at 120 Hz.
        iterations: of the joint refinement of learned satellites.

    Raises:
        FileFormatError: if the clip is too short or lacks one of the joints.
    """
    names = ("root", *clip.skeleton.bones)
    missing = [marker for marker in MARKERS if marker not in names]
    if missing or len(clip) < BORDERS[-1]:
        raise FileFormatError(f"clip '{clip.name}' is not CMU 86 trial 1: {len(clip)} frames, without {missing}")
    markers = 1e3 * clip.joints()[:, [names.index(marker) for marker in MARKERS]]
    for (centers, satellites), paper in PAPER.items():
        for segment, figure in enumerate(paper):
            part = markers[BORDERS[segment] : BORDERS[segment + 1]]
            fixed = fixed_network(part, clip.rate, centers, satellites)
            learned = learned_network(part, clip.rate, centers, satellites, iterations)
            yield Entry(
                centers,
                satellites,
                segment + 1,
                figure,
                float(relative_accuracy(fixed, part).mean()),
                float(relative_accuracy(learned, part).mean()),
                mean_absolute(fixed, part),
                mean_absolute(learned, part),
            )


def fixed_network(markers: Array, rate: float, centers: int, satellites: int, seed: int = 0) -> Array:
    """What the paper's method makes of markers (K, M, 3): satellites stay in place, frequencies are searched."""
    target, scale, time = _scaled(markers, rate)
    duration = len(time) / rate
    places = grid_places(centers, satellites)
    search = FrequencySearch(target, time, places)
    grid = frequency_grid(duration, PAIRS_GRID if centers == 2 else 400)
    found: list[Candidate] = []
    for share in SHARPNESS_PER_SPACING:
        sharpness = share / spacing(centers, satellites)
        if centers <= 2:
            found += search.exhaustive(grid, sharpness)[:2]
        else:
            found += search.at_random(grid[0], grid[-1], RANDOM_TRIES // 3, sharpness, seed)[:2]
    best: tuple[float, Array] | None = None
    for candidate in found:
        # Thinned frames may mislead the refinement: every step is judged again by all of them.
        for choice in (candidate, search.refine(candidate)):
            square = np.square(sines_at(choice.frequency, time)[:, None] - places).sum(-1)
            response = np.exp(-0.5 * choice.sharpness**2 * square)
            output = response @ readout(response, target).T
            error = float(np.square(output - target).sum())
            if best is None or error < best[0]:
                best = (error, output)
    assert best is not None
    return (best[1] * scale).reshape(markers.shape)


def learned_network(
    markers: Array, rate: float, centers: int, satellites: int, iterations: int = 250, seed: int = 0
) -> Array:
    """What learned satellites make of markers (K, M, 3)."""
    target, scale, time = _scaled(markers, rate)
    starts = slow_and_fast(len(time) / rate, centers, 45, seed)
    learned = learn(target, time, satellites, starts, keep=3, iterations=iterations)
    response = learned.respond(time)
    return (response @ ridge_readout(response, target).T * scale).reshape(markers.shape)


def _scaled(markers: Array, rate: float) -> tuple[Array, Array, Array]:
    """Coordinates as columns of unit length, so that squared errors are those of eqs 23-25; their lengths; times."""
    columns = markers.reshape(len(markers), -1)
    scale = np.linalg.norm(columns, axis=0)
    return columns / scale, scale, np.arange(len(markers)) / rate
