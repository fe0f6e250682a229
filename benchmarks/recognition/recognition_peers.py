"""Echo-state experts beside MiniRocket (aeon) in the same folds.

DATA is a folder as `python -m benchmarks recognition` takes it. MiniRocket (4000 kernels on joint positions, every clip
resampled to 96 frames, ridge classifier) is aeon's: pip install aeon. Without it only our rows are measured.
"""

from __future__ import annotations

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks import command
from benchmarks.recognition.baselines import linear_experts
from benchmarks.recognition.contenders import POSITIONS, WITH_VELOCITY, ours
from benchmarks.recognition.folds import measure
from benchmarks.recognition.methods import Method, Prepare, looking_at
from controller.recognition.features import features, resampled
from controller.recognition.labelled_recordings import Example, read_dataset
from controller.recognition.splits import PROTOCOLS

FRAMES, KERNELS = 96, 4000
SEEDS = (1, 2, 3)


def at_one_length(example: Example, stretch: float):
    signal = features(example.clip, POSITIONS, stretch)
    return resampled(signal, (len(signal) - 1) / (FRAMES - 1), 1.0)[:FRAMES]


def minirocket(seed: int) -> Prepare:
    from aeon.classification.convolution_based import MiniRocketClassifier

    def prepare(signals, labels, classes):
        cube = np.array([s.T for s in signals], dtype=np.float32)

        def score(learn, ask):
            classifier = MiniRocketClassifier(n_kernels=KERNELS, random_state=seed)
            classifier.fit(cube[learn], labels[learn])
            return 1.0 - np.eye(classes)[classifier.predict(cube[ask])]

        return score

    return prepare


def main(
    data: Annotated[Path, typer.Argument(metavar="DATA", help="A folder with one folder of recordings a motion.")],
) -> None:
    dataset = read_dataset(data)
    rows = {
        "experts (ours)": ours,
        "linear experts (VAR 2)": lambda seed: [Method("", looking_at(WITH_VELOCITY), linear_experts(2, 0.1))],
    }
    try:
        import aeon  # noqa: F401

        rows["MiniRocket (aeon)"] = lambda seed: [Method("", at_one_length, minirocket(seed))]
    except ImportError:
        print("aeon is not installed: no MiniRocket (pip install aeon)", file=sys.stderr)
    for name, method in rows.items():
        for protocol in PROTOCOLS:
            start = time.perf_counter()
            result = measure(name, method, dataset, protocol, SEEDS)
            took = time.perf_counter() - start
            print(f"{name:<26} {protocol:<10} {result.accuracy:.3f} +- {result.spread:.3f}  {took:6.1f} s", flush=True)


if __name__ == "__main__":
    command.run("recognition_peers", main, __doc__)
