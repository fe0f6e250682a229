"""How fast the worst joins of a library are, over a grid of phases.

Every pair of motions is joined at phases all over the first; measured are speed and acceleration in the world.

python -m benchmarks joins [--library thesis15] [--joining WAY] [--phases 24] [--direct] [--sample N]
    [--chain 200] [--json]

For each pair and phase: the largest speed and acceleration of a joint in the world from the command until the switch
has settled, over the larger of both motions' own (at least 0.5 m/s and 2 m/s^2: a motion may stand still). Without
--direct the deck takes its routes, and a one-shot is left at its end only; with it every pair is joined at once, out of
the middle of one-shots too. --chain adds random switches, each begun while the one before is still under way.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from dataclasses import dataclass

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402

from controller.deck.deck import Deck  # noqa: E402
from controller.deck.joins.deck_motions import read_motions  # noqa: E402
from controller.deck.joins.joining import JOININGS, Joining  # noqa: E402
from controller.library.motion_library import MotionLibrary, load_library  # noqa: E402
from controller.rotations import Array  # noqa: E402
from motiondeck_base.shipped import find_library  # noqa: E402

RATE = 200.0
DT = 1.0 / RATE
LONGEST = 4.0  # s; a switch that takes its way through one-shots is measured as far as that
LEAST_SPEED, LEAST_ACCELERATION = 0.5, 2.0
FASTEST, HARDEST = 1.5, 2.0
"""A join passes up to these multiples of the motions' own peaks."""


@dataclass(frozen=True)
class Peaks:
    """The largest speed (m/s) and acceleration (m/s^2) of a joint in the world."""

    speed: float
    acceleration: float

    @classmethod
    def of(cls, places: Array) -> Peaks:
        """Of joint positions, shape (ticks, joints, 3), m."""
        steps = np.diff(places, axis=0)
        return cls(
            float(np.linalg.norm(steps, axis=-1).max()) * RATE,
            float(np.linalg.norm(np.diff(steps, axis=0), axis=-1).max()) * RATE**2,
        )


@dataclass(frozen=True)
class Join:
    """One join and its peaks over those of its motions."""

    source: str
    target: str
    phase: float
    speed: float
    acceleration: float
    seconds: float

    @property
    def passes(self) -> bool:
        """Whether it stays within the limits."""
        return self.speed <= FASTEST and self.acceleration <= HARDEST


class Measured:
    """A deck whose joint positions in the world are kept."""

    def __init__(
        self, library: MotionLibrary, motion: str, phase: float, joining: Joining | None, *, direct: bool
    ) -> None:
        self.deck = Deck(library, lambda pose: pose.root_position, motion, direct=direct, joining=joining, phase=phase)
        self._skeleton = library.skeleton
        self.places: list[Array] = []

    def tick(self) -> None:
        """One tick of the deck."""
        self.deck.update(DT)
        pose = self.deck.pose
        self.places.append(self._skeleton.joints(pose.root_position, pose.rotation))


def own_peaks(library: MotionLibrary, which: tuple[str, ...] = ()) -> dict[str, Peaks]:
    """The peaks of each motion, or of these, that plays alone, one round of it or until its end."""
    peaks, motions = {}, read_motions(library)
    for name in which or motions:
        motion = motions[name]
        alone = Measured(library, name, 0.0, None, direct=True)
        for _ in range(round(motion.seconds * RATE) + 20):
            alone.tick()
        found = Peaks.of(np.array(alone.places))
        peaks[name] = Peaks(max(found.speed, LEAST_SPEED), max(found.acceleration, LEAST_ACCELERATION))
    return peaks


def measure(
    library: MotionLibrary,
    own: dict[str, Peaks],
    source: str,
    target: str,
    phase: float,
    joining: Joining | None,
    *,
    direct: bool,
) -> Join:
    """One switch at a phase in [0, 1) of the source."""
    run = Measured(library, source, phase, joining, direct=direct)
    for _ in range(3):
        run.tick()
    switch = run.deck.switch(target)
    while switch.settled_s is None and run.deck.time - switch.commanded_s < LONGEST:
        run.tick()
    for _ in range(10):
        run.tick()
    found, on_the_way = Peaks.of(np.array(run.places)), (source, *switch.via, target)
    return Join(
        source,
        target,
        phase,
        found.speed / max(own[name].speed for name in on_the_way),
        found.acceleration / max(own[name].acceleration for name in on_the_way),
        run.deck.time - switch.commanded_s - 10 * DT,
    )


def grid(
    library: MotionLibrary, joining: Joining | None, phases: int, *, direct: bool, sample: int, seed: int
) -> list[Join]:
    """Every pair at every phase, or a random sample; where one-shots are left at their end only, at that alone."""
    own, motions = own_peaks(library), read_motions(library)
    cells: list[tuple[str, str, float]] = []
    for source, motion in motions.items():
        moments = np.arange(phases) / phases if motion.loop or direct else np.array([0.999])
        targets = [target for target in motions if target != source or not motion.loop]
        cells += [(source, target, float(phase)) for target in targets for phase in moments]
    if sample:
        drawn = np.random.default_rng(seed).permutation(len(cells))[:sample]
        cells = [cells[cell] for cell in sorted(drawn)]
    report_progress(f"{len(cells)} joins")
    return [measure(library, own, *cell, joining, direct=direct) for cell in cells]


def chain(library: MotionLibrary, joining: Joining | None, switches: int, *, direct: bool, seed: int) -> list[Join]:
    """Random switches, each commanded 0.05 to 0.8 s after the one before, so that most begin during another."""
    own, rng = own_peaks(library), np.random.default_rng(seed)
    names = list(own)
    run = Measured(library, names[0], 0.0, joining, direct=direct)
    joins, recent = [], [names[0]]
    for _ in range(switches):
        target = str(rng.choice([name for name in names if name != run.deck.motion]))
        source = run.deck.motion
        run.deck.switch(target)
        recent = [*recent[-3:], *run.deck.switches[-1].via, target]  # motions that are still faded out of, or into
        begin = len(run.places)
        for _ in range(round(rng.uniform(0.05, 0.8) * RATE)):
            run.tick()
        found = Peaks.of(np.array(run.places[max(begin - 2, 0) :]))
        speed = found.speed / max(own[name].speed for name in recent)
        acceleration = found.acceleration / max(own[name].acceleration for name in recent)
        joins.append(Join(source, target, 0.0, speed, acceleration, 0.0))
    return joins


def summary(joins: list[Join]) -> dict[str, object]:
    """Percentiles, the share that passes and the worst."""
    speeds, accelerations = ([getattr(join, name) for join in joins] for name in ("speed", "acceleration"))
    worst = sorted(joins, key=lambda join: max(join.speed / FASTEST, join.acceleration / HARDEST))[-5:]
    return {
        "joins": len(joins),
        "percentiles": [50, 95, 99, 100],
        "speed": np.percentile(speeds, (50, 95, 99, 100)).round(2).tolist(),
        "acceleration": np.percentile(accelerations, (50, 95, 99, 100)).round(2).tolist(),
        "seconds": np.percentile([join.seconds for join in joins], (50, 95, 99, 100)).round(2).tolist(),
        "failing": sum(not join.passes for join in joins),
        "worst": [
            f"{join.source} to {join.target} at {join.phase:.3f}: {join.speed:.2f} x speed, "
            f"{join.acceleration:.2f} x acceleration"
            for join in reversed(worst)
        ],
    }


def report_progress(line: str) -> None:
    """A line on standard error."""
    print(line, file=sys.stderr, flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks joins", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--library", default="thesis15")
    parser.add_argument("--joining", choices=JOININGS, help="by default, what suits the network")
    parser.add_argument("--phases", type=int, default=24)
    parser.add_argument("--direct", action="store_true", help="join every pair at once, at every phase")
    parser.add_argument("--chain", type=int, default=0, metavar="N", help="N random switches during switches instead")
    parser.add_argument("--sample", type=int, default=0, metavar="N", help="N joins of the grid, drawn at random")
    parser.add_argument("--seed", type=int, default=1, help="of the random switches, or of the sample")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    library = load_library(find_library(options.library))
    if options.chain:
        joins = chain(library, options.joining, options.chain, direct=options.direct, seed=options.seed)
    else:
        sampled = {"sample": options.sample, "seed": options.seed}
        joins = grid(library, options.joining, options.phases, direct=options.direct, **sampled)
    found = summary(joins)
    if options.json:
        print(json.dumps(found))
        return 0
    print(f"{found['joins']} joins, {found['failing']} beyond {FASTEST} x speed or {HARDEST} x acceleration\n")
    print("| | p50 | p95 | p99 | max |\n|---|---|---|---|---|")
    for name in ("speed", "acceleration", "seconds"):
        row = found[name]
        assert isinstance(row, list)
        print(f"| {name} | " + " | ".join(f"{value:g}" for value in row) + " |")
    assert isinstance(found["worst"], list)
    print("\nworst:\n" + "\n".join(f"  {line}" for line in found["worst"]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
