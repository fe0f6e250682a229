"""How the costs of a centralized network grow with each of its sizes.

Processor time of one thread for a step, for the weights W of a motion, for judging one vector of frequencies in the
search, and for learning satellites (20 iterations), while one of these varies and the others stay at K = 1000 samples,
D = 62 outputs, n = 2 centers, m = 49 satellites: samples, outputs, centers, satellites, and segments of 1000 samples
that a recording is cut into, a network each, one after the other. The last column is the slope of a line through the
logarithms, the power of growth.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks import command
from benchmarks.centralized.centralized_step import motion
from benchmarks.papers.frequency_search import FrequencySearch
from controller.learning.centralized.satellite_learning import learn, ridge_readout, slow_and_fast
from controller.networks.centralized.centers import pairs_at
from controller.networks.centralized.centralized import CentralizedGenerator
from controller.networks.centralized.satellites import GaussianSatellites, grid_places, spacing
from motiondeck.pictures.figures import check_picture, new_figure, save

RATE = 120.0
USUAL = {"samples": 1000, "outputs": 62, "centers": 2, "satellites": 49, "segments": 1}
VARIED = {
    "samples": (250, 500, 1000, 2000, 4000),
    "outputs": (12, 31, 62, 124, 248),
    "centers": (1, 2, 3, 4, 6),
    "satellites": (12, 25, 49, 100, 200),
    "segments": (1, 2, 4),
}
# A step knows nothing of these.
NOT_OF_A_STEP = ("samples", "segments")
COSTS = {"step": "us", "weights": "ms", "search, a candidate": "ms", "learning": "s"}


def seconds(work: Callable[[], object], least: float = 0.04, rounds: int = 9) -> float:
    """Processor time of one call, s: the least of some rounds, each of as many calls as take a while."""
    work()
    calls, taken = 1, []
    while len(taken) < rounds:
        began = time.thread_time()
        for _ in range(calls):
            work()
        spent = time.thread_time() - began
        if spent < least and not taken:
            calls *= 2
            continue
        taken.append(spent / calls)
    return min(taken)


def costs(samples: int, outputs: int, centers: int, satellites: int, segments: int) -> dict[str, float]:
    """What a network of a size costs, in the units of COSTS."""
    rng = np.random.default_rng(0)
    clock = np.arange(samples) / RATE
    target = rng.normal(size=(samples, outputs)).cumsum(0)
    target -= target.mean(0)
    frequency = slow_and_fast(clock[-1], centers, 1, 0)[0]
    placed = GaussianSatellites(rng.normal(size=(satellites, 2 * centers)), rng.uniform(0.5, 2.0, satellites))
    response = placed.respond(pairs_at(frequency, np.zeros(centers), clock))
    generator = CentralizedGenerator({"motion": motion(satellites, centers, outputs)})
    places = grid_places(centers, satellites)
    search = FrequencySearch(target, clock, places)
    sharpness = 1.0 / spacing(centers, satellites)
    starts = slow_and_fast(clock[-1], centers, 1, 0)

    def each(work: Callable[[], object]) -> Callable[[], None]:
        """The work for one segment after the other."""

        def all_of_them() -> None:
            for _ in range(segments):
                work()

        return all_of_them

    return {
        "step": 1e6 * seconds(lambda: generator.step(0.005)),
        "weights": 1e3 * seconds(each(lambda: ridge_readout(response, target))),
        "search, a candidate": 1e3 * seconds(each(lambda: search.judge(frequency, sharpness))),
        "learning": seconds(each(lambda: learn(target, clock, satellites, starts, keep=1, iterations=20)), rounds=1),
    }


def main(
    picture: Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="Draw it (.png, .svg, .pdf).")] = None,
) -> None:
    if picture is not None:
        check_picture(picture)
    print("| varied | cost | " + "sizes: costs | power |\n|---|---|---|---|")
    found: dict[str, dict[str, np.ndarray]] = {}
    for name, sizes in VARIED.items():
        measured = [costs(**USUAL | {name: size}) for size in sizes]
        found[name] = {cost: np.array([one[cost] for one in measured]) for cost in COSTS}
        for cost, unit in COSTS.items():
            if cost == "step" and name in NOT_OF_A_STEP:
                continue
            values = found[name][cost]
            power = np.polyfit(np.log(sizes), np.log(values), 1)[0]
            said = ", ".join(f"{size}: {value:.3g}" for size, value in zip(sizes, values, strict=True))
            print(f"| {name} | {cost}, {unit} | {said} | {power:.2f} |", flush=True)
    if picture is not None:
        draw(found, picture)


def draw(found: dict[str, dict[str, np.ndarray]], picture: Path) -> None:
    """A panel a cost, a line for what is varied, over how many times the usual."""
    from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

    figure = new_figure(15.0, 4.0)
    for axes, (cost, unit) in zip(figure.subplots(1, len(COSTS)), COSTS.items(), strict=True):
        for name, sizes in VARIED.items():
            if cost != "step" or name not in NOT_OF_A_STEP:
                axes.plot(np.array(sizes) / USUAL[name], found[name][cost], "o-", markersize=3.5, label=name)
        axes.set_xscale("log")
        if cost == "step":
            axes.set_ylim(bottom=0.0)
        else:
            axes.set_yscale("log")
            axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.yaxis.set_major_formatter(ScalarFormatter())
            axes.yaxis.set_minor_formatter(NullFormatter())
        axes.set_title(f"{cost}, {unit}")
        axes.set_xticks((0.25, 0.5, 1.0, 2.0, 4.0), ("1/4", "1/2", "1", "2", "4"))
        axes.tick_params(axis="x", which="minor", bottom=False, labelbottom=False)
        axes.set_xlabel("times the usual")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    usual = ", ".join(f"{value} {name}" for name, value in USUAL.items() if name != "segments")
    figure.suptitle(f"processor time; the usual: {usual}")
    save(figure, picture)


if __name__ == "__main__":
    command.run("centralized_growth", main, __doc__)
