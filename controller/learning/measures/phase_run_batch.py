"""Many runs of one motion of a phase-driven network, side by side; fit `run_batch.RunBatch`.

The phase is given and cannot be lost, so what is disturbed are the neurons alone.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from controller.networks.reservoirs.phase_conceptor import PhaseConceptorMotion
from controller.networks.reservoirs.phase_driven import PhaseMotion
from controller.networks.reservoirs.phase_echo_state import PhaseEchoStateMotion

Float32 = NDArray[np.float32]
Motion = TypeVar("Motion", bound=PhaseMotion)


class PhaseBatch(ABC, Generic[Motion]):
    """R runs of one motion.

    Args:
        motion: which; all runs start at its first anchor.
        runs: R.

    Attributes:
        neurons: N.
    """

    def __init__(self, motion: Motion, runs: int) -> None:
        self._part, self._weights = motion, motion.reservoir.weights
        self.neurons = len(self._weights)
        self._frame = np.zeros(runs, dtype=np.int64)
        self._state = np.repeat(motion.states[:1], runs, axis=0)

    @abstractmethod
    def displace(self, noise: Float32) -> None:
        """x(0) = s + noise."""

    @abstractmethod
    def advance(self, noise: Float32 | None = None) -> Float32:
        """Steps every run one frame on, with noise (R, N) on the new state; frames of shape (R, C)."""

    def _read(self) -> Float32:
        """The channels of all runs, shape (R, C)."""
        readout = self._part.readout[self._part.course.piece[self._frame]]
        return np.einsum("rcn,rn->rc", readout[:, :, :-1], self._state) + readout[:, :, -1]


class PhaseConceptorBatch(PhaseBatch[PhaseConceptorMotion]):
    """R runs of one motion of phase-driven conceptors."""

    # Noise on the neurons also reaches W outside the directions that the network stores.
    _push: Float32 | None = None

    def displace(self, noise: Float32) -> None:
        """x(0) = s + noise."""
        directions = self._part.stored.directions[0].astype(np.float32)
        self._state += noise @ directions
        # The part in those directions is in z now and must not count twice.
        self._push = (noise - (noise @ directions) @ directions.T) @ self._weights.T

    def advance(self, noise: Float32 | None = None) -> Float32:
        """x(n+1) = m + C (tanh(W x(n) + W_in (V x(n) + v) + W_phi p + b) + noise - m),  y(n+1) = R x(n+1) + r."""
        part, z, course = self._part, self._state, self._part.course
        leaving = course.piece[self._frame]
        self._frame = course.all_after(self._frame)
        entering = course.piece[self._frame]
        for piece in np.unique(entering):
            rows = np.flatnonzero(entering == piece)
            seam = rows[leaving[rows] != piece]
            z[seam] = z[seam] @ part.hand_on[piece].T + part.shift[piece]
            inputs = np.hstack([z[rows], part.inputs[self._frame[rows]]])
            hidden = inputs @ part.drive[piece, :, :-1].T + part.drive[piece, :, -1]
            if self._push is not None:
                hidden += self._push[rows]
            np.tanh(hidden, out=hidden)
            if noise is not None:
                hidden += noise[rows]
            z[rows] = hidden @ part.project[piece].T - part.offset[piece]
        self._push = None
        return self._read()


class PhaseEchoStateBatch(PhaseBatch[PhaseEchoStateMotion]):
    """R runs of one motion of a phase-driven echo-state network."""

    def displace(self, noise: Float32) -> None:
        """x(0) = s + noise."""
        self._state += noise

    def advance(self, noise: Float32 | None = None) -> Float32:
        """x(n+1) = tanh(W x(n) + W_phi p + W_u u + b) + noise,  y(n+1) = R x(n+1) + r."""
        part = self._part
        self._frame = part.course.all_after(self._frame)
        self._state = np.tanh(self._state @ self._weights.T + part.driven[self._frame] + part.usual * part.drive)
        if noise is not None:
            self._state += noise
        return self._read()
