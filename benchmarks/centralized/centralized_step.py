"""One step of a centralized network beside pydmps.

Processor time of one thread, which a busy machine changes less than the clock's: n = 2 centers, m = 100 satellites, 62
outputs; median of 20 rounds of 2000 steps. pydmps (rhythmic, GPL) is measured in the same run where it is installed:
pip install pydmps. Also: the exhaustive search over 6,000 pairs of frequencies, and finding the like of a motion among
100,000.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable

import numpy as np

from benchmarks import command
from benchmarks.centralized.motion_index import MotionIndex
from benchmarks.papers.frequency_search import FrequencySearch, frequency_grid
from controller.networks.centralized.centralized import CentralizedGenerator, CentralizedMotion
from controller.networks.centralized.satellites import GaussianSatellites, grid_places, spacing

OUTPUTS = 62


def motion(satellites: int, centers: int = 2, outputs: int = OUTPUTS) -> CentralizedMotion:
    rng = np.random.default_rng(0)
    turns = np.arange(1.0, centers + 1)
    return CentralizedMotion(
        frequency=2 * np.pi * turns,
        phase=np.zeros(centers),
        satellites=GaussianSatellites(rng.normal(size=(satellites, 2 * centers)), rng.uniform(0.5, 2, satellites)),
        weights=rng.normal(size=(outputs, satellites)),
        rest=np.zeros(outputs),
        seconds=1.0,
        loop=True,
    )


def microseconds(step: Callable[[], object], steps: int) -> float:
    rounds = []
    for _ in range(20):
        start = time.thread_time()
        for _ in range(steps):
            step()
        rounds.append((time.thread_time() - start) / steps)
    return 1e6 * float(np.median(rounds))


def main() -> None:
    ours = {}
    for centers, satellites, outputs in [
        (2, 100, 62),
        (2, 16, 62),
        (2, 200, 62),
        (1, 100, 62),
        (4, 100, 62),
        (2, 100, 200),
    ]:
        generator = CentralizedGenerator({"motion": motion(satellites, centers, outputs)})
        ours[centers, satellites, outputs] = cost = microseconds(lambda g=generator: g.step(0.005), 2000)
        print(
            f"centralized network, n = {centers}, m = {satellites:3d}, {outputs:3d} outputs {cost:8.1f} us a step",
            flush=True,
        )
    try:
        from pydmps import DMPs_rhythmic

        primitives = DMPs_rhythmic(n_dmps=OUTPUTS, n_bfs=100, dt=0.01)
        primitives.imitate_path(np.sin(np.linspace(0, 6, 600) + np.arange(OUTPUTS)[:, None]), plot=False)
        primitives.reset_state()
        peer = microseconds(primitives.step, 50)
        print(f"pydmps, 100 basis functions, {OUTPUTS} outputs          {peer:8.1f} us a step")
        print(f"that is {peer / ours[2, 100, 62]:.0f} times ours")
    except ImportError:
        print("pydmps is not installed")
    rng = np.random.default_rng(0)
    for frames, satellites in [(1300, 25), (1300, 100)]:
        target = rng.normal(size=(frames, 12)).cumsum(0)
        places = grid_places(2, satellites)
        start = time.thread_time()
        search = FrequencySearch(target, np.arange(frames) / 120, places)
        pairs = len(search.exhaustive(frequency_grid(frames / 120, 111), 1.0 / spacing(2, satellites)))
        taken = time.thread_time() - start
        print(f"search over {pairs} pairs, {frames} frames, 12 outputs, m = {satellites}: {taken:.2f} s", flush=True)
    numbers = np.exp(rng.uniform(0.0, 3.0, (100_000, 9)))
    index = MotionIndex([str(row) for row in range(len(numbers))], numbers)
    print(f"nearest 5 of {len(numbers)} motions: {microseconds(lambda: index.nearest(1.02 * numbers[0]), 100):.0f} us")


if __name__ == "__main__":
    command.run("centralized_step", main, __doc__)
