"""Orbits: the paths of a network's neurons in each motion, in the directions of most variance.

The activations r of all motions, N numbers each, are projected on their first three principal components,
p = D (r - c). Each motion is a closed path there, or one that ends.

The overlap of two motions says how far they use the same directions: with the correlations R = X'X / T,

    |R_i^1/2 R_j^1/2|^2 / (|R_i| |R_j|),

which is the similarity of their conceptors (Jaeger 2014, section 3.8) for small apertures: 1 for equal ones, 0 where
they share no direction.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from controller.motion.rotations import Array
from controller.networks.base import Activation, AnyNetwork

SHOWN = 3
POINTS = 120  # of each motion's path
INNER = 0.95  # this share of all points is within a distance of 1 of the middle


@dataclass(frozen=True)
class Orbits:
    """The paths of motions in three directions of a network's neurons."""

    directions: Activation  # D, shape (3, N), scaled so that nearly all points are within 1 of the middle
    centre: Activation  # c, shape (N,)
    paths: dict[str, Activation]  # of each motion, shape (POINTS, 3) or shorter
    share: float  # of the activations' variance in the three directions
    overlap: Array  # of each two motions, shape (M, M), in the order of the paths

    def point(self, activation: Array) -> Activation:
        """The projection of an activation (N,), shape (3,)."""
        seen: Activation = self.directions @ (activation - self.centre).astype(np.float32)
        return seen


def orbits(network: AnyNetwork, frames: Mapping[str, int]) -> Orbits:
    """The orbits of a network with neurons: plays each motion once, on a twin."""
    player = network.twin()
    out = np.zeros(player.channels)
    activations: dict[str, Activation] = {}
    for motion in player.motions:
        player.cue(motion, 0)
        kept = np.unique(np.linspace(0, frames[motion] - 1, POINTS).astype(int))
        seen: list[Activation] = []
        for frame in range(frames[motion]):
            player.advance(out)
            if frame == kept[len(seen)] and player.activation is not None:
                seen.append(player.activation.copy())
        activations[motion] = np.stack(seen)
    every = np.concatenate([*activations.values()])
    centre = every.mean(0)
    _, strengths, directions = np.linalg.svd(every - centre, full_matrices=False)
    directions = directions[:SHOWN]
    points = (every - centre) @ directions.T
    directions /= max(float(np.quantile(np.linalg.norm(points, axis=1), INNER)), 1e-9)
    found = {motion: (seen - centre) @ directions.T for motion, seen in activations.items()}
    squares = np.square(strengths)
    share = float(squares[:SHOWN].sum() / max(float(squares.sum()), 1e-12))
    # trace(R_i R_j) = |X_i X_j'|^2 / (T_i T_j)
    parts = activations.values()
    products = np.array([[np.square(a @ b.T).mean() for b in parts] for a in parts], dtype=np.float64)
    sizes = np.sqrt(np.maximum(products.diagonal(), 1e-12))
    return Orbits(directions, centre, found, share, products / np.outer(sizes, sizes))
