"""Experts and their model space beside MiniRocket (aeon) in the same folds.

DATA is a folder as `python -m benchmarks recognition` takes it, or mocap6.mat: 12 channels at 10 Hz of two people's
exercises. MiniRocket (4000 kernels on positions, every example resampled to 96 frames, ridge classifier) is aeon's: pip
install aeon. Without it only our rows are measured. With --pieces each recording is cut into pieces of so many frames
(30 a second, of mocap6 10), which are recognized one by one.
"""

from __future__ import annotations

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from scipy import stats
from scipy.io import loadmat

from benchmarks import command
from benchmarks.recognition.baselines import linear_experts
from benchmarks.recognition.committee import GROUPS, NEURONS, committee, with_model_space
from benchmarks.recognition.methods import Prepare, shared_experts
from controller.learning.recognition.experts import STRETCHED_LEAK, ExpertRecipe
from controller.learning.recognition.features import FeatureRecipe, features, resampled, with_velocity
from controller.learning.recognition.labelled_recordings import PROTOCOLS, Protocol, folds, read_dataset
from controller.motion.rotations import Array, Indices
from motiondeck_base.errors import UnknownNameError

FRAMES, KERNELS = 96, 4000
PEER = "MiniRocket (aeon)"
MOCAP6_RATE = 10.0  # Hz


@dataclass(frozen=True)
class Task:
    """What is to be recognized: positions and velocities, shape (T_j, 2 C), of examples with labels and actors."""

    signals: list[Array]
    labels: Indices
    actors: Indices

    def in_pieces(self, frames: int) -> Task:
        """The same cut into pieces of so many frames; what is shorter stays."""
        signals: list[Array] = []
        of: list[int] = []
        for number, signal in enumerate(self.signals):
            starts = range(0, max(1, len(signal) - frames + 1), frames)
            signals += [signal[first : first + frames] for first in starts]
            of += [number] * len(starts)
        return Task(signals, self.labels[of], self.actors[of])

    def at_one_length(self) -> list[Array]:
        """Positions alone, each example at FRAMES frames."""
        found = []
        for signal in self.signals:
            still = resampled(signal[:, : signal.shape[1] // 2], (len(signal) - 1) / (FRAMES - 1), 1.0)[:FRAMES]
            found.append(np.concatenate([still, np.repeat(still[-1:], FRAMES - len(still), axis=0)]))
        return found


def task(data: Path) -> Task:
    """The recordings of a folder, or the segments of mocap6 less 0.2 s after each border."""
    if data.suffix != ".mat":
        dataset = read_dataset(data)
        return Task([features(one.clip, FeatureRecipe()) for one in dataset.examples], dataset.labels, dataset.actors)
    sequences = loadmat(data)["DataBySeq"].ravel()
    every = np.concatenate([one["X"] for one in sequences])
    signals, labels, actors = [], [], []
    for one in sequences:
        names = np.ravel(one["TrueZ"])
        seen = with_velocity((one["X"] - every.mean(0)) / every.std(0), MOCAP6_RATE)
        for begin, end in pairwise([0, *(np.flatnonzero(np.diff(names)) + 1), len(names)]):
            signals.append(seen[begin + 2 : end])
            labels.append(int(names[begin]))
            actors.append(int(one["filename"].ravel()[0].ravel()[0][:2]))
    return Task(signals, np.unique(labels, return_inverse=True)[1], np.array(actors))


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


def _committee(seed: int) -> Prepare:
    return committee(ExpertRecipe(neurons=NEURONS, seed=seed))


def _with_model_space(seed: int) -> Prepare:
    return with_model_space(ExpertRecipe(neurons=NEURONS, groups=GROUPS, leak=STRETCHED_LEAK, seed=seed))


ROWS: dict[str, Callable[[int], Prepare]] = {
    PEER: minirocket,
    "a committee and its model space": _with_model_space,
    "a committee": _committee,
    "single experts": lambda seed: shared_experts(ExpertRecipe(seed=seed)),
    "linear experts (VAR 2)": lambda seed: linear_experts(2, 0.1),
}


def interval(values) -> str:
    """The mean of independent values and its 95 % interval (Student)."""
    values = np.asarray(values)
    spread = values.std(ddof=1) if len(values) > 1 else np.nan
    half = stats.t.ppf(0.975, max(len(values) - 1, 1)) * spread / np.sqrt(len(values))
    return f"{values.mean():.3f} ({values.mean() - half:.3f} to {values.mean() + half:.3f})"


def shares(of: Task, prepare: Prepare, signals: list[Array], protocol: Protocol, seed: int) -> list[tuple[int, int]]:
    """How many examples are named rightly, and how many there are, in each fold."""
    score = prepare(signals, of.labels, int(of.labels.max()) + 1)
    found = []
    for learn, ask in folds(protocol, of.labels, of.actors, seed):
        found.append((int((score(learn, ask).argmin(1) == of.labels[ask]).sum()), len(ask)))
    return found


def main(
    data: Annotated[Path, typer.Argument(metavar="DATA", help="A folder with one folder of recordings a motion.")],
    seeds: Annotated[int, typer.Option("--seeds", metavar="N", min=2, help="Reservoirs, and sets of kernels.")] = 5,
    first: Annotated[int, typer.Option("--first", metavar="SEED", min=0, help="The first of them.")] = 1,
    protocol: Annotated[
        str, typer.Option("--protocol", metavar="NAME", help=f"One of {', '.join(PROTOCOLS)}, or all.")
    ] = "all",
    pieces: Annotated[int, typer.Option("--pieces", metavar="FRAMES", min=0, help="0: recordings as they are.")] = 0,
) -> None:
    if protocol not in ("all", *PROTOCOLS):
        raise UnknownNameError.among("protocol", protocol, [*PROTOCOLS, "all"])
    asked = task(data).in_pieces(pieces) if pieces else task(data)
    rows = dict(ROWS)
    try:
        import aeon  # noqa: F401  # pyright: ignore[reportMissingImports]
    except ImportError:
        del rows[PEER]
        print("aeon is not installed: no MiniRocket (pip install aeon)", file=sys.stderr)
    print(f"{len(asked.signals)} examples of {len(np.unique(asked.labels))} motions")
    print("share named rightly, and its 95 % interval over seeds; what it has more than MiniRocket, over folds")
    protocols: list[Protocol] = [one for one in PROTOCOLS if protocol in ("all", one)]
    for chosen in protocols:
        peer = None
        for name, made in rows.items():
            start = time.perf_counter()
            signals = asked.at_one_length() if name == PEER else asked.signals
            counts = np.array([shares(asked, made(s), signals, chosen, s) for s in range(first, first + seeds)])
            took = time.perf_counter() - start
            by_fold = (counts[..., 0] / counts[..., 1]).mean(0)
            peer = by_fold if name == PEER else peer
            more = "" if name == PEER or peer is None else f"  more: {interval(by_fold - peer)}"
            named = interval(counts[..., 0].sum(1) / counts[..., 1].sum(1))
            print(f"{chosen:<10} {name:<32} {named}{more}  {took:6.1f} s", flush=True)


if __name__ == "__main__":
    command.run("recognition_peers", main, __doc__)
