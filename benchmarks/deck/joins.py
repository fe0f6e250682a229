"""How fast the worst joins of a library are, over a grid of phases.

Every pair of motions is joined at phases all over the first; measured are speed and acceleration in the world.

python -m benchmarks joins [--library thesis15] [--joining WAY] [--phases 24] [--direct] [--sample N]
    [--chain 200] [--json]

For each pair and phase: the largest speed and acceleration of a joint in the world from the command until the switch
has settled, over the larger of both motions' own (at least 0.5 m/s and 2 m/s^2: a motion may stand still). Without
--direct the deck takes its routes, and a one-shot is left at its end only; with it every pair is joined at once, out of
the middle of one-shots too. `--joining blend` blends the second of two loops in, up to a weight of 1. --chain adds
random switches, each begun while the one before is still under way.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from typing import Literal

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402

from controller.deck.joins.deck_motions import read_motions  # noqa: E402
from controller.deck.joins.join_limits import FASTEST, HARDEST  # noqa: E402
from controller.deck.performance import JOININGS, Joining  # noqa: E402
from controller.deck.routes import Routes  # noqa: E402
from controller.deck.worst_join import RATE, Join, MeasuredDeck, play_join  # noqa: E402
from controller.library.motion_library import MotionLibrary, load_library  # noqa: E402
from motiondeck_base.shipped import find_library  # noqa: E402

Way = Joining | Literal["blend"] | None


def blend_over(library: MotionLibrary, source: str, target: str, phase: float, *, direct: bool) -> Join:
    """From one loop to another by a blend whose weight goes to 1."""
    run = MeasuredDeck(library, source, phase, direct=direct)
    return run.until_settled(run.deck.blend_in(source, target, 1.0), source, phase)


def cells_of(library: MotionLibrary, way: Way, phases: int, *, direct: bool) -> list[tuple[str, str, float]]:
    """Every pair at every phase; where one-shots are left at their end only, at that alone."""
    motions, routes = read_motions(library), Routes.of(library)
    cells: list[tuple[str, str, float]] = []
    for source, motion in motions.items():
        moments = np.arange(phases) / phases if motion.loop or direct else np.array([1.0])
        targets = [target for target in motions if target != source or not motion.loop]
        if way == "blend":
            blended = [target for target in targets if motion.loop and motions[target].loop]
            targets = [target for target in blended if direct or not routes.way(source, target)]
        cells += [(source, target, float(phase)) for target in targets for phase in moments]
    return cells


def grid(library: MotionLibrary, way: Way, phases: int, *, direct: bool, sample: int, seed: int) -> list[Join]:
    """Every pair at every phase, or a random sample of them."""
    cells = cells_of(library, way, phases, direct=direct)
    if sample:
        drawn: list[int] = np.random.default_rng(seed).permutation(len(cells))[:sample].tolist()
        cells = [cells[cell] for cell in sorted(drawn)]
    report_progress(f"{len(cells)} joins")
    if way == "blend":
        return [blend_over(library, *cell, direct=direct) for cell in cells]
    return [play_join(library, *cell, way, direct=direct) for cell in cells]


def chain(library: MotionLibrary, joining: Joining | None, switches: int, *, direct: bool, seed: int) -> list[Join]:
    """Random switches, each commanded 0.05 to 0.8 s after the one before, so that most begin during another."""
    rng, names = np.random.default_rng(seed), list(read_motions(library))
    run = MeasuredDeck(library, names[0], joining=joining, direct=direct)
    joins, recent = [], [names[0]]
    for _ in range(switches):
        target = str(rng.choice([name for name in names if name != run.deck.motion]))
        source = run.deck.motion
        run.deck.switch(target)
        recent = [*recent[-3:], *run.deck.switches[-1].via, target]  # motions that are still faded out of, or into
        begin = max(len(run.places) - 2, 0)
        seconds = rng.uniform(0.05, 0.8)
        run.play(round(seconds * RATE))
        joins.append(Join(source, target, 0.0, *run.peaks(recent, begin), seconds))
    return joins


def summary(joins: list[Join]) -> dict[str, object]:
    """Percentiles, the share that passes and the worst."""
    speeds, accelerations = ([getattr(join, name) for join in joins] for name in ("speed", "acceleration"))
    worst = sorted(joins, key=lambda join: join.use)[-5:]
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
    parser.add_argument("--joining", choices=(*JOININGS, "blend"), help="by default, what suits the network")
    parser.add_argument("--phases", type=int, default=24)
    parser.add_argument("--direct", action="store_true", help="join every pair at once, at every phase")
    parser.add_argument("--chain", type=int, default=0, metavar="N", help="N random switches during switches instead")
    parser.add_argument("--sample", type=int, default=0, metavar="N", help="N joins of the grid, drawn at random")
    parser.add_argument("--seed", type=int, default=1, help="of the random switches, or of the sample")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    if options.chain and options.joining == "blend":
        parser.error("--chain plays switches, and a blend is none")
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
