"""How long a switch takes, for every pair that is joined directly.

In seconds of virtual time.

For each pair: the ticks from the command to the first targets that it changed, the frames until nothing was left of the
motion before, and the peak acceleration of a joint in the world on the way, over the larger of both motions' own peaks.
A one-shot is left at its end.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import sys
from pathlib import Path

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402

from controller.deck.deck import Deck  # noqa: E402
from controller.deck.joins.deck_motions import read_motions  # noqa: E402
from controller.deck.performance import JOININGS, Joining  # noqa: E402
from controller.deck.routes import Routes  # noqa: E402
from controller.library.motion_library import MotionLibrary, load_library  # noqa: E402
from controller.motion.rotations import Array  # noqa: E402
from motiondeck_base.shipped import find_library  # noqa: E402

RATE = 200.0
DT = 1.0 / RATE
LONGEST = 3.0  # s


def played(library: MotionLibrary, deck: Deck, seconds: float) -> list[Array]:
    """Joint positions in the world of so many seconds."""
    out = []
    for _ in range(round(seconds * RATE)):
        deck.update(DT)
        out.append(library.skeleton.joints(deck.pose.root_position, deck.pose.rotation))
    return out


def peak(places: list[Array]) -> float:
    """The largest acceleration of a joint, m/s^2."""
    return float(np.linalg.norm(np.diff(np.array(places), n=2, axis=0), axis=-1).max()) * RATE**2


def measure(library: MotionLibrary, source: str, target: str, joining: Joining | None, own: dict[str, float]) -> dict:
    repertoire = read_motions(library)
    deck = Deck(library, lambda pose: pose.root_position, source, direct=True, joining=joining)
    moment = np.random.default_rng([ord(letter) for letter in source + target]).uniform(0.2, 0.8)
    played(library, deck, moment if repertoire[source].loop else repertoire[source].seconds + 0.1)
    places = played(library, deck, 3 * DT)
    switch = deck.switch(target)
    while switch.settled_s is None and deck.time - switch.commanded_s < LONGEST:
        places += played(library, deck, DT)
    places += played(library, deck, 10 * DT)
    settled = switch.settled_s if switch.settled_s is not None else float("inf")
    changed = switch.first_change_s if switch.first_change_s is not None else float("inf")
    return {
        "source": source,
        "target": target,
        "change_ticks": RATE * (changed - switch.commanded_s),
        "settled_frames": library.info.rate * (settled - switch.commanded_s),
        "acceleration": peak(places) / max(own[source], own[target]),
    }


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks switches", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--library", default="thesis15")
    parser.add_argument("--joining", choices=JOININGS, help="default: what suits the network")
    parser.add_argument("--pairs", type=Path, metavar="FILE.csv", help="write a line for each pair")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    library = load_library(find_library(options.library))
    motions = library.network.motions
    routes = Routes.of(library)
    own = {m: peak(played(library, Deck(library, lambda pose: pose.root_position, m), LONGEST)) for m in motions}
    rows = [
        measure(library, source, target, options.joining, own)
        for source in motions
        for target in motions
        if source != target and not routes.way(source, target)
    ]
    if options.pairs is not None:
        with options.pairs.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
    names = ("change_ticks", "settled_frames", "acceleration")
    found = {name: np.percentile([row[name] for row in rows], (50, 95, 99, 100)).round(2).tolist() for name in names}
    if options.json:
        print(json.dumps({"pairs": len(rows), "percentiles": [50, 95, 99, 100], **found}))
        return 0
    print(f"{len(rows)} pairs that are joined directly\n\n| | p50 | p95 | p99 | max |\n|---|---|---|---|---|")
    for name in names:
        print(f"| {name.replace('_', ' ')} | " + " | ".join(f"{value:g}" for value in found[name]) + " |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
