"""Robustness and stability: does a motion survive a wrong start, or noise while it plays? (Deliallisi 2017, 4.1, 4.2)

- Robustness: x(0) = s + noise from U[-50, 50] on each neuron (eq. 4.1), then undisturbed.
- Stability: noise from N(0, 1) on each neuron in each of the first 250 steps (eqs 4.2, 4.4), then undisturbed.

Every run takes 1000 steps, all runs of a motion side by side; `self_test` judges whether each ended on that motion.
Intrinsic runs are the network alone; in guarded ones a guard (`controller/networks/guard.py`) restarts what is lost.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from controller.networks.base import AnyNetwork, AutonomousNetwork
from controller.networks.guard import Beat, LossWatch

Kind = Literal["robustness", "stability"]

STEPS = 1000
START_NOISE = 50.0
NOISY_STEPS = 250


@dataclass(frozen=True)
class GuardKnowledge:
    """The settings of a guard for a batch of runs."""

    beat: Beat
    scale: Array  # the spread of each channel, shape (C,)
    start: Array  # the first anchor's frame, shape (C,)


def disturbed(
    kind: Kind,
    network: AnyNetwork,
    motion: str,
    runs: int,
    rng: np.random.Generator,
    watched: GuardKnowledge | None = None,
    weights: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """The frames, shape (R, STEPS, C), of R disturbed runs of a motion, each from its first anchor on.

    The network's own state is left alone.

    Args:
        watched: for guarded runs, of a network that runs by itself.
        weights: W of a conceptor network, shape (N, N), of which it keeps only k directions; without it only the part
            of a displacement counts that lies in them.
    """
    player, size = network.twin(runs), network.noise_size(motion)
    player.cue(motion, 0)
    if kind == "robustness":
        player.displace(rng.uniform(-START_NOISE, START_NOISE, (runs, size)).astype(np.float32), weights)
    lost, watch = player.as_autonomous, None
    if watched is not None:
        watch = LossWatch(watched.beat, watched.scale, np.repeat(watched.start[None], runs, axis=0))
    frames = np.empty((runs, player.channels))
    out = np.empty((runs, STEPS, player.channels), dtype=np.float32)
    noisy = NOISY_STEPS if kind == "stability" else 0
    with np.errstate(all="ignore"):  # a network that diverges is a result
        for step in range(STEPS):
            if watch is not None and lost is not None:
                _restart(lost, motion, watch, lost.astray())
            player.advance(frames, rng.standard_normal((runs, size), dtype=np.float32) if step < noisy else None)
            if watch is not None and lost is not None:
                _restart(lost, motion, watch, watch.inspect(frames, lost.astray()))
            out[:, step] = frames
    return out


def _restart(network: AutonomousNetwork, motion: str, watch: LossWatch, lost: NDArray[np.bool_]) -> None:
    rows = np.flatnonzero(lost)
    if len(rows):
        network.cue(motion, watch.restart(rows), rows)
