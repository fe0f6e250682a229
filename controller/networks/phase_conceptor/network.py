"""Phase-driven conceptors: a center turns with the motion and drives the reservoir that plays it.

The reservoir of a conceptor network (Deliallisi 2017, eq. 3.8) gets the phase phi of a harmonic center (Vakulenko et
al. 2017, eq. 1) as one more input, while motions are loaded and while they are played, and every motion predicts its
input and its channels for itself:

    p(phi)  = a / sqrt(H) (cos phi, ..., cos H phi, sin phi, ..., sin H phi)
    x(n+1)  = m + C (tanh(W x(n) + W_in (V x(n) + v) + W_phi p(phi(n+1)) + b) - m)
    y(n)    = R x(n) + r

W, W_in, W_phi and b are drawn from a seed and shared; m and C belong to a motion, or to a piece of a long one, and so
do V and R, unless one V, or one V and one R, serve all motions (`shared_conceptor`): then C alone selects. A loop turns
phi round and round. A one-shot turns it by half a turn and stops, so that its end is a fixed point. A long motion is a
chain of pieces, each half a turn, and the state is handed on from one to the next. As in `conceptor`, C ~ U S U' has
rank k and the state is x = m + U z, so that a step costs 2 N k multiplications:

    z(n+1)  = S U' tanh(A z(n) + W_phi p(phi(n+1)) + B) - S U' m,    A = W U + W_in V U,    B = W m + W_in (V m + v) + b

Phase, pieces, tempo and inputs besides the phase are those of `phase_driven`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork, PhaseMotion, PhasePlayer, stored_course
from controller.networks.reservoirs.phase_reservoir import Float32, PhaseCourse, PhaseReservoir
from controller.networks.storage import DrivingInput, MotionHeader, StoredNetwork

Float16 = NDArray[np.float16]
# Weights (C, N + 1) by name: `estimate`, (V, v), in float16 (float32 up to version 7); `readout`, (R, r), in float32.
Shared = Mapping[str, NDArray[Any]]

# What a motion has for itself or shares, as it is stored.
_READERS: dict[str, type] = {"estimate": np.float16, "readout": np.float32}


@dataclass(frozen=True)
class StoredPieces:
    """A motion as a library keeps it: P pieces of rank k in N neurons, with C channels."""

    # U, shape (P, N, k): in 8 bits, each direction to be scaled to length 1, or float16 (up to version 7).
    directions: NDArray[Any]
    strength: Float32  # the diagonal of S, shape (P, k)
    mean: Float16  # m, shape (P, N), half precision
    estimate: Float16  # (V U, V m + v) in normalised channels, shape (P, C, k + 1), half precision
    readout: Float32  # (R U, R m + r) in the units of the encoding, shape (P, C, k + 1)

    @classmethod
    def unread(cls, directions: Array, strength: Array, mean: NDArray[Any], size: tuple[int, int]) -> Self:
        """One piece of directions (N, K), their strengths (K,) and m, without V and R: `size` is (C, k), K <= k."""
        rank = len(strength)
        kept, strong = np.zeros((1, len(mean), size[1]), np.int8), np.zeros((1, size[1]), np.float32)
        kept[0, :, :rank] = np.rint(127.0 / np.abs(directions).max(0) * directions)
        strong[0, :rank] = strength
        unread = np.zeros((1, size[0], size[1] + 1), dtype=np.float32)
        return cls(kept, strong, mean.astype(np.float16)[None], unread.astype(np.float16), unread)

    @property
    def basis(self) -> Float32:
        """U, shape (P, N, k)."""
        if self.directions.dtype == np.float16:
            return self.directions.astype(np.float32)
        length = np.sqrt(np.square(self.directions, dtype=np.float64).sum(1, keepdims=True))
        return (self.directions / np.maximum(length, 1.0)).astype(np.float32)

    def reading(self, shared: NDArray[Any]) -> Float32:
        """Shared weights (A, a) of C channels (C, N + 1) as each piece sees them, (A U, A m + a) (P, C, k + 1)."""
        weights = shared.astype(np.float32)
        seen = weights[:, :-1] @ np.concatenate([self.basis, self.mean[..., None].astype(np.float32)], axis=2)
        seen[..., -1] += weights[:, -1]
        return seen


class PhaseConceptorMotion(PhaseMotion):
    """One motion, ready to be played; what it shares, (V, v) or (R, r) of shape (C, N + 1), replaces what it stores."""

    made = ("states", "by_level", "by_piece")

    def __init__(
        self,
        stored: StoredPieces,
        course: PhaseCourse,
        reservoir: PhaseReservoir,
        driving: DrivingInput | None = None,
        shared: Shared | None = None,
    ) -> None:
        self.shared = shared or {}
        seen: dict[str, Any] = {name: stored.reading(one).astype(_READERS[name]) for name, one in self.shared.items()}
        super().__init__(replace(stored, **seen), course, reservoir, driving)
        phase, self.piece = course.with_lead_in
        usual = np.full((len(phase), reservoir.drive_weights.shape[1]), self.usual, dtype=np.float32)
        # (p, u) at each frame and before, u as usual, shape (T + SETTLING_STEPS, I); I is 2 H, or 2 H + 1 with inputs.
        self.inputs = np.hstack([reservoir.harmonics_of(phase), usual])

    def sharing(self, name: str, weights: NDArray[Any]) -> Self:
        """The motion with its `estimate` or `readout` shared, of shape (C, N + 1)."""
        shared = {**self.shared, name: weights}
        return type(self)(self.stored, self.course, self.reservoir, self.driving, shared)

    def reading_with(self, readout: Float32) -> Self:
        stored = replace(self.stored, readout=readout)
        return type(self)(stored, self.course, self.reservoir, self.driving, self.shared)

    @cached_property
    def by_piece(self) -> list[tuple[Float32, Float32, Float32, Float32, Float32]]:
        """The matrices of each piece, as views that a step multiplies with."""
        stored, reservoir = self.stored, self.reservoir
        directions, mean, estimate = stored.basis, stored.mean.astype(np.float32), stored.estimate.astype(np.float32)
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
        directions = self.motion.stored.basis[self.motion.course.piece[self.frame]]
        self.state += noise @ directions
        self._push = (noise - (noise @ directions) @ directions.T) @ self.motion.reservoir.weights.T


class PhaseConceptorNetwork(PhaseDrivenNetwork[PhaseConceptorMotion]):
    """Plays motions with phase-driven conceptors frame by frame; fits `base.PhaseNetwork`."""

    kind = "phase-conceptor"

    def arrays(self) -> dict[str, NDArray[Any]]:
        found = super().arrays()
        for name in self.motions:
            for part, weights in self[name].shared.items():
                del found[f"motion/{name}/{part}"]
                found[f"shared/{part}"] = weights
        return found

    @property
    def mixable(self) -> dict[str, PhaseConceptorMotion]:
        """The loops of one piece that share V and R."""
        parts = {name: self[name] for name in self.motions if self[name].course.loop and len(self[name].shared) == 2}
        return {name: part for name, part in parts.items() if len(part.stored.mean) == 1 and part.driving is None}

    @classmethod
    def load_motions(
        cls, stored: StoredNetwork, sizes: dict[str, int], reservoir: PhaseReservoir
    ) -> dict[str, PhaseConceptorMotion]:
        whole = sizes | {"m": sizes["n"] + 1}
        shared: dict[str, NDArray[Any]] = {}
        for name in _READERS:
            if f"shared/{name}" in stored.stored:
                shared |= stored.read("shared/", whole, (np.float16, np.float32), **{name: "cm"})
        return {one.name: cls.load_motion(stored, one, sizes, reservoir, shared) for one in stored.header.motions}

    @classmethod
    def load_motion(
        cls,
        stored: StoredNetwork,
        motion: MotionHeader,
        sizes: dict[str, int],
        reservoir: PhaseReservoir,
        all_share: Shared | None = None,
    ) -> PhaseConceptorMotion:
        """One motion of a file; all have one rank."""
        at = f"motion/{motion.name}/"
        if (there := stored.stored.size(at + "directions", 1)) != sizes["n"]:
            raise stored.error(f"{sizes['n']} neurons in its header, {there} in '{at}directions'")
        sizes.setdefault("k", stored.stored.size(at + "directions", 2))
        sizes["e"] = sizes["k"] + 1
        own = dict(sizes)
        parts = stored.read(at, own, (np.int8, np.float16), directions="pnk") | stored.read(at, own, strength="pk")
        parts |= stored.read(at, own, np.float16, mean="pn")
        shared = {name: weights for name, weights in (all_share or {}).items() if at + name not in stored.stored}
        for name, kind in _READERS.items():
            unread = np.zeros((own["p"], own["c"], own["e"]), dtype=kind)
            parts[name] = unread if name in shared else stored.read(at, own, kind, **{name: "pce"})[name]
        course = stored_course(stored, motion, own["p"])
        return PhaseConceptorMotion(StoredPieces(**parts), course, reservoir, motion.input, shared)


KIND = PhaseConceptorNetwork
