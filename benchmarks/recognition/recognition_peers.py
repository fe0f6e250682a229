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
from scipy import stats

from benchmarks import command
from benchmarks.recognition.baselines import linear_experts
from benchmarks.recognition.contenders import POSITIONS, WITH_VELOCITY, in_committee, ours
from benchmarks.recognition.folds import measure
from benchmarks.recognition.methods import Method, Prepare, looking_at
from controller.learning.recognition.features import features, resampled
from controller.learning.recognition.labelled_recordings import PROTOCOLS, Example, Protocol, read_dataset
from motiondeck_base.errors import UnknownNameError

FRAMES, KERNELS = 96, 4000
PEER = "MiniRocket (aeon)"


def at_one_length(example: Example, stretch: float):
    signal = features(example.clip, POSITIONS, stretch)
    return resampled(signal, (len(signal) - 1) / (FRAMES - 1), 1.0)[:FRAMES]


def minirocket(seed: int) -> Prepare:
    from aeon.classification.convolution_based import MiniRocketClassifier  # pyright: ignore[reportMissingImports]

    def prepare(signals, labels, classes):
        cube = np.array([s.T for s in signals], dtype=np.float32)

        def score(learn, ask):
            classifier = MiniRocketClassifier(n_kernels=KERNELS, random_state=seed)
            classifier.fit(cube[learn], labels[learn])
            return 1.0 - np.eye(classes)[classifier.predict(cube[ask])]

        return score

    return prepare


def interval(values) -> str:
    """The mean of independent values and its 95 % interval (Student)."""
    values = np.asarray(values)
    spread = values.std(ddof=1) if len(values) > 1 else np.nan
    half = stats.t.ppf(0.975, max(len(values) - 1, 1)) * spread / np.sqrt(len(values))
    return f"{values.mean():.3f} ({values.mean() - half:.3f} to {values.mean() + half:.3f})"


def main(
    data: Annotated[Path, typer.Argument(metavar="DATA", help="A folder with one folder of recordings a motion.")],
    seeds: Annotated[int, typer.Option("--seeds", metavar="N", min=2, help="Reservoirs, and sets of kernels.")] = 5,
    protocol: Annotated[
        str, typer.Option("--protocol", metavar="NAME", help=f"One of {', '.join(PROTOCOLS)}, or all.")
    ] = "all",
) -> None:
    dataset = read_dataset(data)
    rows = {
        "experts, a committee (ours)": in_committee,
        "experts, single (ours)": ours,
        "linear experts (VAR 2)": lambda seed: [Method("", looking_at(WITH_VELOCITY), linear_experts(2, 0.1))],
    }
    try:
        import aeon  # noqa: F401  # pyright: ignore[reportMissingImports]

        rows = {PEER: lambda seed: [Method("", at_one_length, minirocket(seed))]} | rows
    except ImportError:
        print("aeon is not installed: no MiniRocket (pip install aeon)", file=sys.stderr)
    print("share named rightly, and its 95 % interval over seeds; what it has more than MiniRocket, over folds")
    if protocol not in ("all", *PROTOCOLS):
        raise UnknownNameError.among("protocol", protocol, [*PROTOCOLS, "all"])
    asked: list[Protocol] = [one for one in PROTOCOLS if protocol in ("all", one)]
    for chosen in asked:
        peer = None
        for name, method in rows.items():
            start = time.perf_counter()
            result = measure(name, method, dataset, chosen, range(1, seeds + 1))
            took = time.perf_counter() - start
            by_fold = np.array(result.by_fold).mean(0)
            peer = by_fold if name == PEER else peer
            more = "" if name == PEER or peer is None else f"  more: {interval(by_fold - peer)}"
            shares = interval([np.mean(one) for one in result.by_fold])
            print(f"{chosen:<10} {name:<28} {shares}{more}  {took:6.1f} s", flush=True)


if __name__ == "__main__":
    command.run("recognition_peers", main, __doc__)
