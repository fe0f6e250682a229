"""Blends of three motions: how fast joints move, and whether drops are seen.

python -m benchmarks many_blends [--library thesis15] [--half 0|1] [--every N] [--json]

Of every three loops of a library that can be blended, the second and third are blended into the first (a third each),
get other weights, then the third is dropped, and then the first. Measured are, while weights change, the largest speed
and acceleration of a joint in the world over the largest of the motions' own; the third difference of the rotation of
any bone, over 5 ms each, in the ticks around a drop, and how much that is of the largest in the three motions alone;
how many blends are given up; and how far the mean of three is from where more steps would lead. Settings are chosen on
the one half of the triples, every other one, and stated on the other.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402

from controller.deck.deck import Deck  # noqa: E402
from controller.deck.joins import posture_blend  # noqa: E402
from controller.deck.joins.deck_motions import read_motions  # noqa: E402
from controller.deck.joins.join_limits import FASTEST, HARDEST  # noqa: E402
from controller.deck.routes import Routes  # noqa: E402
from controller.library.motion_library import MotionLibrary, load_library  # noqa: E402
from controller.motion.rotations import Array, conjugate, multiply, to_rotation_vector  # noqa: E402
from motiondeck_base.shipped import find_library  # noqa: E402

RATE = 200.0  # Hz
BESIDE = 4  # ticks before and after a drop that a third difference of it may lie in
HELD = 100  # ticks for which each blend is played
LONGEST = 6.0  # s until a blend has settled


@dataclass
class Run:
    """What a deck has shown."""

    places: list[Array] = field(default_factory=list[Array])
    rotations: list[Array] = field(default_factory=list[Array])

    def peaks(self, begin: int) -> tuple[float, float]:
        """The largest speed and acceleration of a joint from a tick on, m/s and m/s^2."""
        step = np.diff(self.places[begin:], axis=0)
        speed = float(np.linalg.norm(step, axis=-1).max()) * RATE
        return speed, float(np.linalg.norm(np.diff(step, axis=0), axis=-1).max()) * RATE**2

    def jerks(self) -> Array:
        """The largest third difference of the rotation of a bone, of each tick but the first three, rad."""
        rotations = np.array(self.rotations)
        turns = to_rotation_vector(multiply(rotations[1:], conjugate(rotations[:-1])))
        return np.linalg.norm(np.diff(turns, n=2, axis=0), axis=-1).max(1)


def play(deck: Deck, library: MotionLibrary, run: Run, ticks: int) -> None:
    """Plays on and keeps what is shown."""
    for _ in range(ticks):
        _, pose = deck.update(1.0 / RATE)
        run.places.append(library.skeleton.joints(pose.root_position, pose.rotation))
        run.rotations.append(pose.rotation)


def triples(library: MotionLibrary) -> list[tuple[str, str, str]]:
    """Every three loops that can be blended, in an order of their own: which one leads is drawn."""
    routes, rng = Routes.of(library), np.random.default_rng(7)
    loops = [name for name, motion in read_motions(library).items() if motion.loop]
    near = {pair for pair in combinations(loops, 2) if not (routes.way(*pair) or routes.way(*reversed(pair)))}
    found = [three for three in combinations(loops, 3) if all(pair in near for pair in combinations(three, 2))]
    return [tuple(three[k] for k in rng.permutation(3)) for three in found]  # type: ignore[misc]


@dataclass
class Found:
    """What is measured of one triple; see the head of this file."""

    names: str
    speed: float = 0.0
    acceleration: float = 0.0
    drop: float = 0.0
    given_up: int = 0


def measured(library: MotionLibrary, three: tuple[str, str, str], phase: float) -> Found:
    """Plays one triple through its blends."""
    first, second, third = three
    deck, run, found = Deck(library, lambda pose: pose.root_position, first, phase=phase), Run(), Found(" ".join(three))
    motions = [deck.performance.motions[name] for name in three]
    speed, acceleration = (max(getattr(motion, name) for motion in motions) for name in ("speed", "acceleration"))
    play(deck, library, run, 10)
    blends = [
        (second, 1.0 / 3.0, [(third, 1.0 / 3.0)]),
        (second, 0.6, [(third, 0.2)]),
        (second, 0.5, []),
        (second, 1.0, []),
    ]
    for other, weight, also in blends:
        if deck.playing != first or (also and deck.fell_back):
            break
        begin = len(run.places) - 3
        switch = deck.blend_in(first, other, weight, also)
        while switch.settled_s is None and not switch.overtaken and deck.time - switch.commanded_s < LONGEST:
            play(deck, library, run, 1)
        settled = len(run.places)
        play(deck, library, run, BESIDE)
        its = run.peaks(begin)
        found.speed, found.acceleration = (
            max(found.speed, its[0] / speed),
            max(found.acceleration, its[1] / acceleration),
        )
        if not also and switch.settled_s is not None:
            found.drop = max(found.drop, float(run.jerks()[settled - BESIDE - 3 :].max()))
        play(deck, library, run, HELD)
        if deck.fell_back:
            found.given_up += 1
            break
    return found


def alone(library: MotionLibrary) -> dict[str, float]:
    """The largest third difference of the rotation of a bone in each loop alone, rad."""
    found = {}
    for name, motion in read_motions(library).items():
        if motion.loop:
            deck, run = Deck(library, lambda pose: pose.root_position, name), Run()
            play(deck, library, run, round(motion.seconds * RATE) + 10)
            found[name] = float(run.jerks().max())
    return found


def apart_from_more_steps(library: MotionLibrary, three: tuple[str, str, str], steps: int) -> float:
    """How far the mean of thirds is from where thirty steps lead, largest over bones and moments, rad."""
    postures = [library.encoding.decode(library.network.anchors(name)[::3]).rotation for name in three]
    points = np.array([one[: min(map(len, postures))] for one in postures])
    for other in points[1:]:
        other[(other * points[0]).sum(-1) < 0.0] *= -1.0
    weights, usual = np.full(3, 1.0 / 3.0), posture_blend.MEAN_STEPS
    means = []
    for count in (steps, 30):
        posture_blend.MEAN_STEPS = count
        means.append(posture_blend.weighted_mean(points, weights))
    posture_blend.MEAN_STEPS = usual
    return float(np.linalg.norm(to_rotation_vector(multiply(means[0], conjugate(means[1]))), axis=-1).max())


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks many_blends", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--library", default="thesis15")
    parser.add_argument("--half", type=int, choices=(0, 1), default=1, help="0: settings were chosen on these triples")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="take every Nth of these only")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    library = load_library(find_library(options.library))
    chosen = triples(library)[options.half :: 2][:: options.every]
    phases = np.random.default_rng(3 + options.half).uniform(0.0, 1.0, len(chosen))
    own = alone(library)
    rows = [measured(library, three, phase) for three, phase in zip(chosen, phases.tolist(), strict=True)]
    report: dict[str, Any] = {
        "triples": len(rows),
        "beyond": sum(row.speed > FASTEST or row.acceleration > HARDEST for row in rows),
        "speed": np.percentile([row.speed for row in rows], (50, 95, 100)).round(2).tolist(),
        "acceleration": np.percentile([row.acceleration for row in rows], (50, 95, 100)).round(2).tolist(),
        "third_difference_of_drops": np.percentile([row.drop for row in rows], (50, 95, 100)).round(5).tolist(),
        "of_that_in_motions_alone": np.percentile(
            [row.drop / max(own[name] for name in row.names.split()) for row in rows], (50, 95, 100)
        )
        .round(2)
        .tolist(),
        "given_up": sum(row.given_up for row in rows),
        "mean_after_steps": {
            steps: np.percentile([apart_from_more_steps(library, three, steps) for three in chosen], (50, 95, 100))
            .round(4)
            .tolist()
            for steps in (1, 2, 3, 5)
        },
        "worst": [
            f"{row.names}: {row.speed:.2f} x speed, {row.acceleration:.2f} x acceleration, drop {row.drop:.4f}"
            for row in sorted(rows, key=lambda row: max(row.speed / FASTEST, row.acceleration / HARDEST))[-4:]
        ],
    }
    if options.json:
        print(json.dumps(report))
        return 0
    worst = report.pop("worst")
    print(f"{options.library}, half {options.half}; percentiles 50, 95, 100")
    print("\n".join(f"{name.replace('_', ' '):28} {value}" for name, value in report.items()))
    print("worst:\n" + "\n".join(f"  {line}" for line in reversed(worst)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
