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
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from controller.networks.driving_input import DrivingInput
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork, PhaseMotion, PhasePlayer, stored_course
from controller.networks.reservoirs.phase_reservoir import Float32, PhaseCourse, PhaseReservoir
from controller.networks.storage import MotionHeader, StoredNetwork

Float16 = NDArray[np.float16]


@dataclass(frozen=True)
class StoredPieces:
    """A motion as a library keeps it: P pieces of rank k in N neurons, with C channels."""

    directions: Float16  # U, shape (P, N, k), half precision
    strength: Float32  # the diagonal of S, shape (P, k)
    mean: Float16  # m, shape (P, N), half precision
    estimate: Float16  # (V U, V m + v) in normalised channels, shape (P, C, k + 1), half precision
    readout: Float32  # (R U, R m + r) in the units of the encoding, shape (P, C, k + 1)


class PhaseConceptorMotion(PhaseMotion):
    """One motion, ready to be played."""

    made = ("states", "by_level", "by_piece")

    def __init__(
        self, stored: StoredPieces, course: PhaseCourse, reservoir: PhaseReservoir, driving: DrivingInput | None = None
    ) -> None:
        super().__init__(stored, course, reservoir, driving)
        phase, self.piece = course.with_lead_in
        usual = np.full((len(phase), reservoir.drive_weights.shape[1]), self.usual, dtype=np.float32)
        # (p, u) at each frame and before, u as usual, shape (T + SETTLING_STEPS, I); I is 2 H, or 2 H + 1 with inputs.
        self.inputs = np.hstack([reservoir.harmonics_of(phase), usual])

    @cached_property
    def by_piece(self) -> list[tuple[Float32, Float32, Float32, Float32, Float32]]:
        """The matrices of each piece, as views that a step multiplies with."""
        stored, reservoir = self.stored, self.reservoir
        directions, mean, estimate = (a.astype(np.float32) for a in (stored.directions, stored.mean, stored.estimate))
        pieces, neurons, rank = directions.shape
        inputs = self.inputs.shape[1]
        # (A, W_phi, W_u, B) of each piece, shape (P, N, k + I + 1), to be multiplied with (z, p, u, 1).
        drive = np.empty((pieces, neurons, rank + inputs + 1), dtype=np.float32)
        drive[:, :, :rank] = reservoir.weights @ directions
        drive[:, :, :rank] += reservoir.input_weights @ estimate[:, :, :-1]
        drive[:, :, rank:-1] = np.hstack([reservoir.phase_weights, reservoir.drive_weights])
        drive[:, :, -1] = mean @ reservoir.weights.T + reservoir.bias
        drive[:, :, -1] += estimate[:, :, -1] @ reservoir.input_weights.T
        # S U' of each piece, shape (P, k, N).
        project = np.ascontiguousarray(stored.strength[:, :, None] * directions.transpose(0, 2, 1))
        offset = np.einsum("pkn,pn->pk", project, mean)  # S U' m of each piece, shape (P, k)
        before = np.roll(np.arange(pieces), 1)
        # x = m + U z of the piece before, seen in the directions of this one: what its state is multiplied with, shape
        # (P, k, k), and what is added, (P, k).
        hand_on = np.einsum("pnk,pnl->pkl", directions, directions[before])
        shift = np.einsum("pnk,pn->pk", directions, mean[before] - mean)
        turned = zip(hand_on, shift, drive, project, offset, strict=True)
        return [(hand.T, by, weights.T, onto.T, off) for hand, by, weights, onto, off in turned]

    def player(self, frame: int, state: Float32, level: float, runs: tuple[int, ...] = ()) -> PhaseConceptorPlayer:
        return PhaseConceptorPlayer(self, frame, state, level, runs)


class PhaseConceptorPlayer(PhasePlayer[PhaseConceptorMotion]):
    """A motion while it plays; its state is z."""

    def __init__(
        self, motion: PhaseConceptorMotion, frame: int, state: Float32, level: float, runs: tuple[int, ...] = ()
    ) -> None:
        super().__init__(motion, frame, state, level, runs)
        rank, inputs = state.shape[-1], motion.inputs.shape[1]
        self._input = np.ones((*runs, rank + inputs + 1), dtype=np.float32)
        self._before, self._given = self._input[..., :rank], self._input[..., rank:-1]
        self._new = np.zeros((*runs, rank), dtype=np.float32)

    def place(self, motion: PhaseConceptorMotion, frame: int, state: Float32) -> None:
        super().place(motion, frame, state)
        # Noise on the neurons also reaches W outside the stored directions, within tanh of the next step.
        self._push: Float32 | None = None

    def step(self, frame: int, noise: Float32 | None = None) -> None:
        """Goes on to a frame whose phase is near the present one; noise is added to tanh of the equation."""
        motion, z, hidden, new = self.motion, self.state, self.activation, self._new
        piece = motion.piece[frame]
        hand_on, shift, drive, project, offset = motion.by_piece[piece]
        if piece != motion.piece[self.frame]:
            np.dot(z, hand_on, out=new)
            np.add(new, shift, out=z)
        self._before[...] = z
        self._given[...] = motion.inputs[frame]
        if motion.driving is not None:
            self._given[..., -1] = self.level
        np.dot(self._input, drive, out=hidden)
        if self._push is not None:
            hidden += self._push
            self._push = None
        np.tanh(hidden, out=hidden)
        if noise is not None:
            hidden += noise
        np.dot(hidden, project, out=new)
        np.subtract(new, offset, out=z)
        self.frame = frame

    def displace(self, noise: Float32) -> None:
        """x(0) = s + noise: the part in the stored directions goes into z, the rest into the next step."""
        directions = self.motion.stored.directions[self.motion.course.piece[self.frame]].astype(np.float32)
        self.state += noise @ directions
        self._push = (noise - (noise @ directions) @ directions.T) @ self.motion.reservoir.weights.T


class PhaseConceptorNetwork(PhaseDrivenNetwork[PhaseConceptorMotion]):
    """Plays motions with phase-driven conceptors frame by frame; fits `base.PhaseNetwork`."""

    kind = "phase-conceptor"

    @classmethod
    def load_motion(
        cls, stored: StoredNetwork, motion: MotionHeader, sizes: dict[str, int], reservoir: PhaseReservoir
    ) -> PhaseConceptorMotion:
        """One motion of a file; all have one rank."""
        at = f"motion/{motion.name}/"
        if (there := stored.stored.size(at + "directions", 1)) != sizes["n"]:
            raise stored.error(f"{sizes['n']} neurons in its header, {there} in '{at}directions'")
        sizes.setdefault("k", stored.stored.size(at + "directions", 2))
        sizes["e"] = sizes["k"] + 1
        own = dict(sizes)
        half = stored.read(at, own, np.float16, directions="pnk", mean="pn", estimate="pce")
        pieces = StoredPieces(**half, **stored.read(at, own, strength="pk", readout="pce"))
        return PhaseConceptorMotion(pieces, stored_course(stored, motion, own["p"]), reservoir, motion.input)


KIND = PhaseConceptorNetwork
