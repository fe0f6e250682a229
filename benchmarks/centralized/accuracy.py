"""Whole-body errors of every method at the same number of parameters.

Mean absolute error of a coordinate in mm, joints (or markers) in the world, mean over pieces of about 3.5 s that
`plane_segments` cuts a recording into. What is counted is every number that a method needs to play its piece: means,
weights, knots, places, frequencies. Every method that has a choice takes it with the error in view: PCA its rank,
Fourier its period; free knots move by L-BFGS. movement_primitives (DMP, ProMP; BSD) is measured where it is installed:
pip install movement-primitives.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from scipy.interpolate import BSpline
from scipy.optimize import minimize
from threadpoolctl import threadpool_limits

from benchmarks import command
from benchmarks.centralized.centralized_filling import places_of
from benchmarks.centralized.plane_segments import plane_segments
from benchmarks.papers.segment_network import play_segment
from controller.learning.centralized.low_rank_learning import learn_low_rank
from controller.learning.centralized.satellite_learning import principal_scores, slow_and_fast
from controller.motion.rotations import Array

PIECE_S = 3.5
PARAMETERS = [10, 18, 35]
DEGREE = 3
CENTERS = (1, 2)
ITERATIONS = 300

Method = Callable[[Array, float, int], Array]
"""A piece (K, D) as a method plays it, by its rate and how many parameters there are for each of its D outputs."""


def cubic_splines(count: int, inner: Array | None = None) -> Callable[[int], Array]:
    """The basis of some cubic splines over K frames, their inner knots in (0, 1) evenly spread or given."""
    inner = np.linspace(0.0, 1.0, count - DEGREE + 1)[1:-1] if inner is None else inner
    knots = np.concatenate([np.zeros(DEGREE + 1), inner, np.ones(DEGREE + 1)])
    return lambda frames: BSpline.design_matrix(np.linspace(0.0, 1.0, frames), knots, DEGREE).toarray()


def fitted(basis: Array, part: Array) -> Array:
    """The sum of basis functions (K, m) nearest to a piece."""
    return basis @ np.linalg.lstsq(basis, part, rcond=1e-10)[0]


def squared(output: Array, part: Array) -> float:
    return float(np.square(output - part).sum())


def even_splines(part: Array, _rate: float, each: int) -> Array:
    return fitted(cubic_splines(each)(len(part)), part)


def free_splines(part: Array, _rate: float, each: int) -> Array:
    """Knots are shared by all outputs."""
    outputs = part.shape[1]
    count = (each * outputs + DEGREE + 1) // (outputs + 1)
    return fitted(cubic_splines(count, free_knots(part, count))(len(part)), part)


def free_knots(part: Array, count: int) -> Array:
    """The inner knots of `count` splines that fit a piece best, from evenly spread ones."""
    middle = part.mean(0)
    scores = principal_scores(part - middle)
    floor = 1e-12 * max(1e-12, float(np.square(scores).sum()))

    def knots(gaps: Array) -> Array:
        share = np.exp(gaps - gaps.max()) + 1e-6
        return np.cumsum(share / share.sum())[:-1]

    def loss(gaps: Array) -> float:
        return float(np.log(squared(fitted(cubic_splines(count, knots(gaps))(len(scores)), scores), scores) + floor))

    start = np.zeros(count - DEGREE)
    found = minimize(loss, start, method="L-BFGS-B", bounds=[(-4.0, 4.0)] * len(start), options={"maxiter": 40})
    return knots(found.x if found.fun < loss(start) else start)


def ranks(part: Array, budget: int) -> list[tuple[int, int, Array, Array, Array]]:
    """Every rank r that leaves enough for m functions: r, m, scores (K, r), directions (r, D) and the mean."""
    outputs, middle = part.shape[1], part.mean(0)
    left, size, directions = np.linalg.svd(part - middle, full_matrices=False)
    found = []
    for r in range(1, len(size) + 1):
        m = min(len(part), (budget - outputs - outputs * r) // r)
        if m <= DEGREE + 1:
            break
        found.append((r, m, left[:, :r] * size[:r], directions[:r], middle))
    return found


def principal_splines(part: Array, _rate: float, each: int) -> Array:
    tries = [
        fitted(cubic_splines(m)(len(part)), scores) @ directions + middle
        for _, m, scores, directions, middle in ranks(part, each * part.shape[1])
    ]
    return min(tries, key=lambda output: squared(output, part))


def principal_free_splines(part: Array, _rate: float, each: int) -> Array:
    """With the rank that is best for even knots, and those next to it."""
    every = ranks(part, each * part.shape[1])
    errors = [squared(fitted(cubic_splines(m)(len(part)), s) @ d + middle, part) for _, m, s, d, middle in every]
    best, tries = int(np.argmin(errors)), []
    for r, m, scores, directions, middle in every[max(0, best - 1) : best + 2]:
        count = m - m // (r + 1)  # a knot costs one, its weights r
        knots = free_knots(scores, count)
        tries.append(fitted(cubic_splines(count, knots)(len(part)), scores) @ directions + middle)
    return min(tries, key=lambda output: squared(output, part))


def cosines(part: Array, _rate: float, each: int) -> Array:
    x = (np.arange(len(part)) + 0.5) / len(part)
    return fitted(np.cos(np.pi * np.multiply.outer(x, np.arange(each))), part)


def fourier(part: Array, _rate: float, each: int) -> Array:
    """Constant, trend, sines and cosines of the best of some base periods."""
    x = np.linspace(0.0, 1.0, len(part))
    tries = []
    for stretch in np.linspace(1.0, 2.0, 11):
        angle = 2.0 * np.pi * np.multiply.outer(x / stretch, np.arange(1, each // 2 + 1))
        waves = np.stack([np.cos(angle), np.sin(angle)], axis=-1).reshape(len(x), -1)
        tries.append(fitted(np.column_stack([np.ones(len(x)), x, waves])[:, :each], part))
    return min(tries, key=lambda output: squared(output, part))


def dynamic_primitives(part: Array, rate: float, each: int) -> Array:
    """Start and goal of each output count as parameters."""
    from movement_primitives.dmp import DMP

    time = np.arange(len(part)) / rate
    primitive = DMP(part.shape[1], execution_time=time[-1], dt=1.0 / rate, n_weights_per_dim=each - 2)
    primitive.imitate(time, part)
    return primitive.open_loop(run_t=time[-1])[1][: len(part)]


def probabilistic_primitives(part: Array, rate: float, each: int) -> Array:
    from movement_primitives.promp import ProMP

    time = np.arange(len(part)) / rate
    primitive = ProMP(part.shape[1], n_weights_per_dim=each)
    weights = primitive.weights(time, part)
    return primitive.trajectory_from_weights(time, weights)


def full_network(part: Array, rate: float, each: int) -> Array:
    """W of full rank, two centers: a weight for each output, five numbers a satellite, four for the centers."""
    outputs = part.shape[1]
    return play_segment(part, rate, max(1, ((each - 1) * outputs - 4) // (outputs + 5)))


def low_rank_network(part: Array, rate: float, each: int) -> Array:
    middle, time = part.mean(0), np.arange(len(part)) / rate
    tries = []
    for centers in CENTERS:
        network = learn_low_rank(
            part - middle,
            time,
            slow_and_fast(len(part) / rate, centers, 30, 0),
            satellites=len(part),
            parameters=(each - 1) * part.shape[1],
            iterations=ITERATIONS,
        )
        assert network.numbers <= (each - 1) * part.shape[1]
        tries.append(network.play(time) + middle)
    return min(tries, key=lambda output: squared(output, part))


OURS = "low-rank network"
METHODS: dict[str, Method] = {
    OURS: low_rank_network,
    "full network": full_network,
    "PCA + splines": principal_splines,
    "PCA + free knots": principal_free_splines,
    "splines": even_splines,
    "free knots": free_splines,
    "Fourier": fourier,
    "cosines": cosines,
    "DMP": dynamic_primitives,
    "ProMP": probabilistic_primitives,
}


def pieces_of(path: Path) -> tuple[list[Array], float]:
    """A recording cut into pieces (K, D), mm, and its rate, Hz; markers that are not seen throughout are left out."""
    places, rate = places_of(path)
    flat = places.reshape(len(places), -1)
    flat = flat[:, np.isfinite(flat).all(axis=0)]
    count = max(1, round(len(flat) / rate / PIECE_S))
    cuts = plane_segments(flat - flat.mean(0), rate, count) if count > 1 else [(0, len(flat))]
    return [flat[first:end] for first, end in cuts], rate


def main(
    files: Annotated[list[Path], typer.Argument(metavar="RECORDING...", help="Joints (.amc) or markers (.c3d).")],
    parameters: Annotated[list[int] | None, typer.Option(help="For each output.")] = None,
) -> None:
    methods = dict(METHODS)
    try:
        import movement_primitives  # noqa: F401
    except ImportError:
        print("movement_primitives is not installed: DMP and ProMP are left out\n")
        methods = {name: method for name, method in methods.items() if not name.endswith("MP")}
    print("| recording | pieces | each | " + " | ".join(methods) + " | best other / low-rank network |")
    print("|---" * (len(methods) + 4) + "|")
    lost = []
    for file in files:
        pieces, rate = pieces_of(file)
        for each in parameters or PARAMETERS:
            with threadpool_limits(1):
                errors = {
                    name: float(np.mean([np.abs(method(part, rate, each) - part).mean() for part in pieces]))
                    for name, method in methods.items()
                }
            rival = min((name for name in errors if name != OURS), key=lambda name: errors[name])
            cells = [f"{error:.3g}" for error in errors.values()]
            ratio = errors[rival] / errors[OURS]
            lost += [f"{file.stem} at {each}: {rival} is better"] if ratio < 1.0 else []
            row = " | ".join([file.stem, str(len(pieces)), str(each), *cells, f"{ratio:.2f} ({rival})"])
            print(f"| {row} |", flush=True)
    print("\n" + ("\n".join(lost) if lost else "the low-rank network has the least error in every row"))


if __name__ == "__main__":
    command.run("accuracy", main, __doc__)
