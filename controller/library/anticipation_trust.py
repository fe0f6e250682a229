"""How far a prediction is trusted: what the network says, the last velocity, and for the rest the last pose, held.

`Trust` knows it from the library, `Experience` from what came true of earlier predictions of the same recording.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from controller.rotations import Array

AHEAD_FRAMES = 30
TRUST_LEVELS = 4  # distances, each with as many of the trials
PRIOR_TRIALS = 2.0  # for so many predictions of a recording the trust from the library counts


@dataclass(frozen=True)
class Trust:
    """How much of a prediction comes true, by how far what is seen is from what is known.

    Attributes:
        distance: shape (L,), mm, rising from 0, where the network is trusted fully.
        network: share of the network's movement at each frame ahead, shape (L, AHEAD_FRAMES); it never rises.
        velocity: share of the movement at the last velocity, shape (L, AHEAD_FRAMES).
    """

    distance: Array
    network: Array
    velocity: Array

    @classmethod
    def learn(cls, distance: Array, network: Array, velocity: Array, came: Array) -> Trust:
        """From trials: their distances (T,) and what was predicted and came, less the last pose, (T, frames, F)."""
        if not len(distance):
            return cls(np.zeros(1), np.ones((1, AHEAD_FRAMES)), np.zeros((1, AHEAD_FRAMES)))
        order = np.argsort(distance)
        levels = [these for these in np.array_split(order, TRUST_LEVELS) if len(these)]
        shares = np.zeros((len(levels), AHEAD_FRAMES, 2))
        for frame in range(AHEAD_FRAMES):

            def fitted(these: NDArray[np.intp], frame: int = frame) -> Array:
                ways = np.stack([network[these, frame].ravel(), velocity[these, frame].ravel()], axis=-1)
                return np.minimum(nnls(ways, came[these, frame].ravel())[0], 1.0)

            # What is further away is not known better: levels where it seems so are taken together.
            pools = [([level], fitted(these)) for level, these in enumerate(levels)]
            while (worse := next((k for k in range(1, len(pools)) if pools[k][1][0] > pools[k - 1][1][0]), 0)) > 0:
                joined = pools[worse - 1][0] + pools[worse][0]
                pools[worse - 1 : worse + 1] = [(joined, fitted(np.concatenate([levels[k] for k in joined])))]
            for these, share in pools:
                shares[these, frame] = share
        known = np.concatenate([[0.0], [float(np.median(distance[these])) for these in levels]])
        full = np.broadcast_to([1.0, 0.0], (1, AHEAD_FRAMES, 2))
        together = np.concatenate([full, shares])
        return cls(known, together[:, :, 0], together[:, :, 1])

    def at(self, distance: float) -> tuple[Array, Array]:
        """The shares of network and velocity at a distance, each (AHEAD_FRAMES,); beyond the last the network fades."""
        beyond = min(1.0, float(self.distance[-1]) / distance) if len(self.distance) > 1 and distance > 0.0 else 1.0
        level = float(np.interp(distance, self.distance, np.arange(len(self.distance))))
        below, share = int(level), level - int(level)
        above = min(below + 1, len(self.distance) - 1)
        network, velocity = ((1 - share) * part[below] + share * part[above] for part in (self.network, self.velocity))
        return beyond * network, velocity


class Experience:
    """What came true of earlier predictions of a recording, at each frame ahead."""

    def __init__(self) -> None:
        self._trials = np.zeros(AHEAD_FRAMES)
        self._gram = np.zeros((AHEAD_FRAMES, 2, 2))
        self._came = np.zeros((AHEAD_FRAMES, 2))

    def add(self, ahead: int, network: Array, velocity: Array, came: Array) -> None:
        """Takes in what was predicted so many frames ahead in both ways, and what came, less the last pose, (F,)."""
        ways = np.stack([network, velocity])
        self._trials[ahead - 1] += 1.0
        self._gram[ahead - 1] += ways @ ways.T
        self._came[ahead - 1] += ways @ came

    def correct(self, network: Array, velocity: Array) -> tuple[Array, Array]:
        """The shares of network and velocity, each (AHEAD_FRAMES,), by the library and by what came true.

        Least squares over all earlier predictions, in which the shares by the library count as PRIOR_TRIALS of them.
        """
        shares = np.stack([network, velocity], axis=1)
        for frame in np.flatnonzero(self._trials):
            gram, trials = self._gram[frame], self._trials[frame]
            prior = np.diag(gram) * PRIOR_TRIALS / trials + 1e-9
            root = np.linalg.cholesky(gram + np.diag(prior))
            shares[frame] = nnls(root.T, np.linalg.solve(root, self._came[frame] + prior * shares[frame]))[0]
        return np.minimum(shares[:, 0], 1.0), np.minimum(shares[:, 1], 1.0)
