"""What conceptor, prediction, recurrence and phase each do in one network.

    python -m benchmarks conceptor_selects --data DIR [--sources thesis15 cmu] [--seeds 21 22 23]

One network with a shared readout is trained for a source and seed. Then one part is taken away or exchanged *while it
plays*, without training it again, and each loop is played until it has settled. The error is the mean distance of
joints from the recording at the same phase, mm: the median loop of a seed, and its least and largest over the seeds.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.reservoirs.phase_networks import learned, training_set
from controller.learning.measures.self_test import distances
from controller.learning.trainers.shared_conceptor import SharedConceptorRecipe
from controller.learning.training_set import TrainingSet
from controller.motion.encodings.motion_matching import joint_features
from controller.networks.phase_conceptor.network import PhaseConceptorMotion

# One piece a motion, so that any conceptor goes with any phase.
RECIPE = SharedConceptorRecipe(readout="shared", piece_seconds=1e3)

Parts = dict[str, PhaseConceptorMotion]
Change = Callable[[PhaseConceptorMotion, PhaseConceptorMotion], PhaseConceptorMotion]


def built(part: PhaseConceptorMotion, **changes: Any) -> PhaseConceptorMotion:
    """A motion with some of what it is made of exchanged."""
    given: dict[str, Any] = {name: getattr(part, name) for name in ("stored", "course", "reservoir", "shared")}
    return PhaseConceptorMotion(**(given | changes))


def without_conceptor(part: PhaseConceptorMotion, _: PhaseConceptorMotion) -> PhaseConceptorMotion:
    """The motion with C = I."""
    neurons = part.stored.mean.shape[1]
    whole, open_ = np.eye(neurons, dtype=np.float16)[None], np.ones((1, neurons), dtype=np.float32)
    return built(part, stored=replace(part.stored, directions=whole, strength=open_))


CHANGES: dict[str, Change] = {
    "as learned": lambda part, _: part,
    "no conceptor (C = I)": without_conceptor,
    "the next motion's conceptor": lambda part, other: built(part, stored=other.stored),
    "a quarter turn of phase off": lambda part, _: built(
        part, course=replace(part.course, phase=part.course.phase + 0.5 * np.pi)
    ),
    "no phase (W_phi = 0)": lambda part, _: built(
        part, reservoir=replace(part.reservoir, phase_weights=np.zeros_like(part.reservoir.phase_weights))
    ),
    "no prediction (V = 0)": lambda part, _: built(
        part, shared={**part.shared, "estimate": np.zeros_like(part.shared["estimate"])}
    ),
    "no recurrence (W = 0)": lambda part, _: built(
        part, reservoir=replace(part.reservoir, weights=np.zeros_like(part.reservoir.weights))
    ),
}


def errors(known: TrainingSet, parts: Parts, change: Change) -> np.ndarray:
    """The error of each loop with something changed, mm."""
    names, found = list(parts), []
    for name, after in zip(names, [*names[1:], names[0]], strict=True):
        played = change(parts[name], parts[after]).read()
        features = (joint_features(known.encoding, frames) for frames in (played, known.frames[name]))
        found.append(float(np.mean(distances(*features))))
    return np.array(found)


def table(known: TrainingSet, seeds: list[int], recipe: SharedConceptorRecipe = RECIPE) -> dict[str, np.ndarray]:
    """The median error of each change, a number for each seed, mm."""
    found: dict[str, list[float]] = {name: [] for name in CHANGES}
    for seed in seeds:
        network, _ = learned(recipe, known, seed)
        parts: Parts = {name: network[name] for name in network.motions if known.loops[name]}
        for name, change in CHANGES.items():
            found[name].append(float(np.median(errors(known, parts, change))))
    return {name: np.array(values) for name, values in found.items()}


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks conceptor_selects",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, required=True, help="the folder with the recordings")
    parser.add_argument("--sources", nargs="+", default=["thesis15", "cmu"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[21, 22, 23])
    parser.add_argument("--json", action="store_true", help="one JSON object a source")
    options = parser.parse_args()
    with threadpool_limits(1):
        for source in options.sources:
            found = table(training_set(options.data, source), options.seeds)
            if options.json:
                print(json.dumps({"source": source} | {name: values.tolist() for name, values in found.items()}))
                continue
            own = np.median(found["as learned"])
            print(f"{source}\n| | error, mm | times |\n|---|---|---|")
            for name, values in found.items():
                middle = np.median(values)
                print(f"| {name} | {middle:.2f} ({values.min():.2f} to {values.max():.2f}) | {middle / own:.1f} |")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
