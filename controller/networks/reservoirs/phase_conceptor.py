"""Phase-driven conceptors: a center turns with the motion and drives the reservoir that plays it.

The reservoir of a conceptor network (Deliallisi 2017, eq. 3.8) gets the phase phi of a harmonic center (Vakulenko et
al. 2017, eq. 1) as one more input, while motions are loaded and while they are played, and every motion predicts its
input and its channels for itself:

    p(phi)  = a / sqrt(H) (cos phi, ..., cos H phi, sin phi, ..., sin H phi)
    x(n+1)  = m + C (tanh(W x(n) + W_in (V x(n) + v) + W_phi p(phi(n+1)) + b) - m)
    y(n)    = R x(n) + r

W, W_in, W_phi and b are drawn from a seed and shared; m, C, V and R belong to a motion, or to a piece of a long one. A
loop turns phi round and round. A one-shot turns it by half a turn and stops, so that its end is a fixed point. A long
motion is a chain of pieces, each half a turn, and the state is handed on from one to the next. As in `conceptor`,
C ~ U S U' has rank k and the state is x = m + U z, so that a step costs 2 N k multiplications:

    z(n+1)  = S U' tanh(A z(n) + W_phi p(phi(n+1)) + B) - S U' m,    A = W U + W_in V U,    B = W m + W_in (V m + v) + b

Phase, pieces, tempo and inputs besides the phase are those of `phase_driven`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.networks.reservoirs.driving_input import DrivingInput
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork, PhaseMotion, PhaseVoice
from controller.networks.reservoirs.phase_reservoir import Float32, PhaseCourse, PhaseReservoir

Float16 = NDArray[np.float16]


@dataclass(frozen=True)
class StoredPieces:
    """A motion as a library keeps it: P pieces of rank k in N neurons, with C channels.

    Attributes:
        directions: U, shape (P, N, k), half precision.
        strength: the diagonal of S, shape (P, k).
        mean: m, shape (P, N), half precision.
        estimate: (V U, V m + v) in normalised channels, shape (P, C, k + 1), half precision.
        readout: (R U, R m + r) in the units of the encoding, shape (P, C, k + 1).
    """

    directions: Float16
    strength: Float32
    mean: Float16
    estimate: Float16
    readout: Float32


class PhaseConceptorMotion(PhaseMotion):
    """One motion, ready to be played.

    Args:
        stored: its pieces.
        course: of its phase.
        reservoir: the weights that it shares with others.
        driving: its input besides the phase, if it has one.

    Attributes:
        drive: (A, W_phi, W_u, B) of each piece, shape (P, N, k + I + 1), to be multiplied with (z, p, u, 1).
        project: S U' of each piece, shape (P, k, N).
        offset: S U' m of each piece, shape (P, k).
        hand_on: from the state of the piece before to that of each piece, shape (P, k, k), and
        shift: what is added to it, shape (P, k).
        inputs: (p, u) at each frame, u at its usual value, shape (T, I); I is 2 H, or 2 H + 1 with inputs.
    """

    def __init__(
        self, stored: StoredPieces, course: PhaseCourse, reservoir: PhaseReservoir, driving: DrivingInput | None = None
    ) -> None:
        super().__init__(stored, course, reservoir, driving)
        usual = np.full((len(course.phase), reservoir.drive_weights.shape[1]), self.usual, dtype=np.float32)
        self.inputs = np.hstack([reservoir.harmonics_of(course.phase), usual])
        directions, mean, estimate = (a.astype(np.float32) for a in (stored.directions, stored.mean, stored.estimate))
        pieces, neurons, rank = directions.shape
        inputs = self.inputs.shape[1]
        self.drive = np.empty((pieces, neurons, rank + inputs + 1), dtype=np.float32)
        self.drive[:, :, :rank] = reservoir.weights @ directions
        self.drive[:, :, :rank] += reservoir.input_weights @ estimate[:, :, :-1]
        self.drive[:, :, rank:-1] = np.hstack([reservoir.phase_weights, reservoir.drive_weights])
        self.drive[:, :, -1] = mean @ reservoir.weights.T + reservoir.bias
        self.drive[:, :, -1] += estimate[:, :, -1] @ reservoir.input_weights.T
        self.project = np.ascontiguousarray(stored.strength[:, :, None] * directions.transpose(0, 2, 1))
        self.offset = np.einsum("pkn,pn->pk", self.project, mean)
        # x = m + U z of the piece before, seen in the directions of this one.
        before = np.roll(np.arange(pieces), 1)
        self.hand_on = np.einsum("pnk,pnl->pkl", directions, directions[before])
        self.shift = np.einsum("pnk,pn->pk", directions, mean[before] - mean)
        self.settle()

    def voice(self, frame: int, state: Float32, level: float) -> PhaseConceptorVoice:
        """What plays it from a frame on, in a state, its input at a level."""
        return PhaseConceptorVoice(self, frame, state, self.drive.shape[1], level)


class PhaseConceptorVoice(PhaseVoice[PhaseConceptorMotion]):
    """A motion while it plays; its state is z."""

    def __init__(self, motion: PhaseConceptorMotion, frame: int, state: Float32, neurons: int, level: float) -> None:
        super().__init__(motion, frame, state, neurons, level)
        rank, inputs = len(state), motion.inputs.shape[1]
        self._input = np.ones(rank + inputs + 1, dtype=np.float32)
        self._before, self._given = self._input[:rank], self._input[rank:-1]
        self._handed = np.zeros(rank, dtype=np.float32)

    def step(self, frame: int) -> None:
        """Goes on to a frame whose phase is near the present one."""
        motion, z, hidden = self.motion, self.state, self.activation
        piece = motion.course.piece[frame]
        if piece != motion.course.piece[self.frame]:
            np.dot(motion.hand_on[piece], z, out=self._handed)
            np.add(self._handed, motion.shift[piece], out=z)
        self._before[...] = z
        self._given[...] = motion.inputs[frame]
        if motion.driving is not None:
            self._given[-1] = self.level
        np.dot(motion.drive[piece], self._input, out=hidden)
        np.tanh(hidden, out=hidden)
        np.dot(motion.project[piece], hidden, out=z)
        np.subtract(z, motion.offset[piece], out=z)
        self.frame = frame


class PhaseConceptorNetwork(PhaseDrivenNetwork[PhaseConceptorMotion]):
    """Plays motions with phase-driven conceptors frame by frame; fits `base.InputNetwork`."""
