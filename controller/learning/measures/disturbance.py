"""Robustness and stability: does a motion survive a wrong start, or noise while it plays? (Deliallisi 2017, 4.1, 4.2)

- Robustness: x(0) = s + noise from U[-50, 50] on each neuron (eq. 4.1), then undisturbed.
- Stability: noise from N(0, 1) on each neuron in each of the first 250 steps (eqs 4.2, 4.4), then undisturbed.

Every run takes 1000 steps; whether it ended on the motion that was meant is judged by the criterion of
`self_test.py`. Intrinsic runs are the network alone, guarded ones have a `guard.py` that looks on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from controller.learning.measures.run_batch import LosableBatch, RunBatch
from controller.motion.rotations import Array
from controller.networks.guard import Beat, LossWatch

Kind = Literal["robustness", "stability"]

STEPS = 1000
START_NOISE = 50.0
NOISY_STEPS = 250


@dataclass(frozen=True)
class GuardKnowledge:
    """The settings of a guard for a batch of runs.

    Attributes:
        beat: of the motion.
        scale: the spread of each channel, shape (C,).
        start: the first anchor's frame, shape (C,).
    """

    beat: Beat
    scale: Array
    start: Array


def disturbed(
    kind: Kind, batch: RunBatch, runs: int, rng: np.random.Generator, watched: GuardKnowledge | None = None
) -> NDArray[np.float32]:
    """Disturbs a batch of runs at its start, and plays it.

    Args:
        kind: of disturbance.
        batch: the runs.
        runs: R.
        rng: source of the noise.
        watched: for guarded runs, of a network that may lose its place.

    Returns:
        What was played, shape (R, STEPS, C).
    """
    if kind == "robustness":
        batch.displace(rng.uniform(-START_NOISE, START_NOISE, (runs, batch.neurons)).astype(np.float32))
    watch = LossWatch(watched.beat, watched.scale, np.repeat(watched.start[None], runs, axis=0)) if watched else None
    out: list[NDArray[np.float32]] = []
    noisy = NOISY_STEPS if kind == "stability" else 0
    with np.errstate(all="ignore"):  # a network that diverges is a result
        for step in range(STEPS):
            if watch is not None and isinstance(batch, LosableBatch):
                _put_back(batch, watch, batch.astray())
            noise = rng.standard_normal((runs, batch.neurons), dtype=np.float32) if step < noisy else None
            frames = batch.advance(noise)
            if watch is not None and isinstance(batch, LosableBatch):
                _put_back(batch, watch, watch.look(frames.astype(np.float64), batch.astray()))
            out.append(frames)
    return np.stack(out, axis=1)


def _put_back(batch: LosableBatch, watch: LossWatch, lost: NDArray[np.bool_]) -> None:
    rows = np.flatnonzero(lost)
    if len(rows):
        batch.cue(rows, watch.restart(rows))
