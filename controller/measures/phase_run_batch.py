"""Many runs of one motion of a phase-driven network, side by side; fit `run_batch.RunBatch`.

The phase is given and cannot be lost, so what is disturbed are the neurons alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.networks.reservoirs.phase_conceptor import PhaseConceptorNetwork
from controller.networks.reservoirs.phase_echo_state import PhaseEchoStateNetwork
from controller.networks.reservoirs.phase_reservoir import ANCHOR_EVERY, PhaseReservoir

Float32 = NDArray[np.float32]


class PhaseBatch:
    """R runs of one motion.

    Args:
        network: what plays.
        motion: which motion; all runs start at its first anchor.
        runs: R.

    Attributes:
        neurons: N.
    """

    def __init__(self, network: PhaseConceptorNetwork, motion: str, runs: int) -> None:
        self.neurons = network.neurons
        self._part = network[motion]
        # Noise on the neurons also reaches W outside the directions that the network stores.
        self._reservoir = PhaseReservoir.draw(network.scales, network.channels, network.seed)
        self._frame = np.zeros(runs, dtype=np.int64)
        self._z = np.repeat(self._part.states[:1], runs, axis=0)
        self._push: Float32 | None = None

    def displace(self, noise: Float32) -> None:
        """x(0) = s + noise."""
        directions = self._part.stored.directions[0].astype(np.float32)
        self._z += noise @ directions
        # The part in those directions is in z now and must not count twice.
        self._push = (noise - (noise @ directions) @ directions.T) @ self._reservoir.weights.T

    def advance(self, noise: Float32 | None = None) -> Float32:
        """x(n+1) = m + C (tanh(W x(n) + W_in (V x(n) + v) + W_phi p + b) + noise - m),  y(n+1) = R x(n+1) + r."""
        part, course = self._part, self._part.course
        leaving = course.piece[self._frame]
        self._frame = course.all_after(self._frame)
        entering = course.piece[self._frame]
        out = np.empty((len(self._z), part.readout.shape[1]), dtype=np.float32)
        for piece in np.unique(entering):
            rows = np.flatnonzero(entering == piece)
            seam = rows[leaving[rows] != piece]
            self._z[seam] = self._z[seam] @ part.hand_on[piece].T + part.shift[piece]
            inputs = np.hstack([self._z[rows], part.inputs[self._frame[rows]]])
            hidden = inputs @ part.drive[piece, :, :-1].T + part.drive[piece, :, -1]
            if self._push is not None:
                hidden += self._push[rows]
            np.tanh(hidden, out=hidden)
            if noise is not None:
                hidden += noise[rows]
            self._z[rows] = hidden @ part.project[piece].T - part.offset[piece]
            out[rows] = self._z[rows] @ part.readout[piece, :, :-1].T + part.readout[piece, :, -1]
        self._push = None
        return out

    def cue(self, rows: NDArray[Any], anchors: NDArray[Any]) -> None:
        """Puts some of the runs to anchors."""
        self._frame[rows] = anchors * ANCHOR_EVERY
        self._z[rows] = self._part.states[anchors * ANCHOR_EVERY]
        if self._push is not None:
            self._push[rows] = 0.0

    def astray(self) -> NDArray[np.bool_]:
        """None: a bounded state at a given phase always leads back, shape (R,)."""
        return np.zeros(len(self._z), dtype=bool)


class PhaseEchoStateBatch:
    """R runs of one motion of a phase-driven echo-state network.

    Args:
        network: what plays.
        motion: which motion; all runs start at its first anchor.
        runs: R.

    Attributes:
        neurons: N.
    """

    def __init__(self, network: PhaseEchoStateNetwork, motion: str, runs: int) -> None:
        self.neurons = network.neurons
        self._part, self._weights = network[motion], network.reservoir.weights
        self._frame = np.zeros(runs, dtype=np.int64)
        self._x = np.repeat(self._part.states[:1], runs, axis=0)

    def displace(self, noise: Float32) -> None:
        """x(0) = s + noise."""
        self._x += noise

    def advance(self, noise: Float32 | None = None) -> Float32:
        """x(n+1) = tanh(W x(n) + W_phi p + b) + noise,  y(n+1) = R x(n+1) + r."""
        part, course = self._part, self._part.course
        self._frame = course.all_after(self._frame)
        self._x = np.tanh(self._x @ self._weights.T + part.driven[self._frame])
        if noise is not None:
            self._x += noise
        readout = part.readout[course.piece[self._frame]]
        return np.einsum("rcn,rn->rc", readout[:, :, :-1], self._x) + readout[:, :, -1]

    def cue(self, rows: NDArray[Any], anchors: NDArray[Any]) -> None:
        """Puts some of the runs to anchors."""
        self._frame[rows] = anchors * ANCHOR_EVERY
        self._x[rows] = self._part.states[anchors * ANCHOR_EVERY]

    def astray(self) -> NDArray[np.bool_]:
        """None: a given phase always leads back, shape (R,)."""
        return np.zeros(len(self._x), dtype=bool)
