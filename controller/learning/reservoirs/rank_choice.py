"""Chooses the smallest rank of a conceptor within a tolerance of the full one, in mm of the joints.

From each stored state the full and the cut conceptor take one step, and the joints are compared. A run would not do:
two correct networks at slightly different tempos soon differ.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from controller.motion.encodings.encoding import Encoding
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.rotations import Array
from controller.networks.conceptor.network import ConceptorMotion, ConceptorNetwork


def cut_to_tolerance(
    network: ConceptorNetwork, encoding: Encoding, tolerance_mm: float, motions: Iterable[str] | None = None
) -> ConceptorNetwork:
    """The network with some motions, or all, cut to the smallest rank within a tolerance of their joints, mm."""
    parts = {name: network[name] for name in network.motions}
    for name in network.motions if motions is None else motions:
        parts[name] = cut(parts[name], rank_within(parts[name], encoding, tolerance_mm))
    return network.with_motions(parts)


def rank_within(part: ConceptorMotion, encoding: Encoding, tolerance_mm: float) -> int:
    """The smallest rank k >= 1 from which on the next frame of every stored state is within the tolerance, mm."""
    exact = _joints_after_a_step(part, len(part.offset), encoding)
    for rank in range(len(part.offset) - 1, 0, -1):
        if off_mm(exact, _joints_after_a_step(part, rank, encoding)) > tolerance_mm:
            return rank + 1
    return 1


def off_mm(exact: Array, cut_off: Array) -> float:
    """The largest distance between frames of joints (A, F), each the root mean square over its joints, mm."""
    return float(np.sqrt(np.square(exact - cut_off).sum(1).max() / (exact.shape[1] / 3.0)))


def cut(part: ConceptorMotion, rank: int) -> ConceptorMotion:
    """A motion in its first k directions."""
    return ConceptorMotion(
        recurrent=np.ascontiguousarray(part.recurrent[:, :rank]),
        bias=part.bias,
        project=part.project[:rank].copy(),
        offset=part.offset[:rank].copy(),
        readout=np.ascontiguousarray(part.readout[:, :rank]),
        rest=part.rest,
        states=np.ascontiguousarray(part.states[:, :rank]),
    )


def _joints_after_a_step(part: ConceptorMotion, rank: int, encoding: Encoding) -> Array:
    """The joints one step after each stored state, playing in the first k directions, shape (A, F), mm."""
    hidden = np.tanh(part.states[:, :rank] @ part.recurrent[:, :rank].T + part.bias)
    z = hidden @ part.project[:rank].T - part.offset[:rank]
    return joint_features(encoding, (z @ part.readout[:, :rank].T + part.rest).astype(np.float64))
