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

One step is one frame's worth of phase: tempo is how many steps are made a second, and never changes what is played.

A motion may have an input u besides the phase (`driving_input`): W_u u is added within tanh, and W_u is drawn after the
other weights.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.mocap.encodings.normalisation import Normalisation
from controller.networks.base import Channels
from controller.networks.reservoirs.driving_input import LEVELS, DrivingInput
from controller.networks.reservoirs.phase_reservoir import (
    ANCHOR_EVERY,
    SETTLING_STEPS,
    Float32,
    PhaseCourse,
    PhaseReservoir,
    PhaseScales,
    read_settled,
)
from motiondeck_base.errors import UnknownNameError

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


class PhaseMotion:
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
        states: z at each frame once the network has settled, shape (T, k).
        by_level: the same at each of LEVELS, shape (L, T, k), of a motion with an input.
    """

    def __init__(
        self, stored: StoredPieces, course: PhaseCourse, reservoir: PhaseReservoir, driving: DrivingInput | None = None
    ) -> None:
        self.stored, self.course, self.driving = stored, course, driving
        self.readout = stored.readout
        self.usual = driving.level(driving.usual) if driving is not None else 0.0
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
        self.states = self.settled_at(self.usual)
        self.by_level = (
            np.stack([self.settled_at(level) for level in LEVELS]) if driving is not None else self.states[None]
        )

    def __len__(self) -> int:
        return len(self.course.phase)

    def state_at(self, frame: int, level: float) -> Float32:
        """The state that the motion settles in at a frame, with its input at a level."""
        if self.driving is None:
            return self.states[frame]
        place = float(np.interp(level, LEVELS, np.arange(len(LEVELS))))
        below = min(int(place), len(LEVELS) - 2)
        share = np.float32(place - below)
        return (1 - share) * self.by_level[below, frame] + share * self.by_level[below + 1, frame]

    def settled_at(self, level: float) -> Float32:
        """The states that the motion is led to from wherever it starts, its input at a level, shape (T, k)."""
        states = np.zeros((len(self), self.project.shape[1]), dtype=np.float32)
        voice = PhaseVoice(self, -SETTLING_STEPS % len(self) if self.course.loop else 0, states[0], level)
        for _ in range(SETTLING_STEPS):
            voice.step(voice.next if self.course.loop else 0)
        states[0] = voice.z
        for frame in range(1, len(self)):
            voice.step(frame)
            states[frame] = voice.z
        return states


class PhaseVoice:
    """A motion while it plays: its state z, the frame it is at, the level of its input, and its neurons' activation."""

    def __init__(self, motion: PhaseMotion, frame: int, z: Float32, level: float = 0.0) -> None:
        inputs, neurons = motion.inputs.shape[1], motion.drive.shape[1]
        self.hidden = np.zeros(neurons, dtype=np.float32)
        self._input = np.ones(len(z) + inputs + 1, dtype=np.float32)
        self._before, self._given = self._input[: len(z)], self._input[len(z) : -1]
        self._handed = np.zeros(len(z), dtype=np.float32)
        # z and a 1 side by side, for the readout.
        self._state = np.ones(len(z) + 1, dtype=np.float32)
        self.z = self._state[:-1]
        self.level = level
        self.place(motion, frame, z)

    def place(self, motion: PhaseMotion, frame: int, z: Float32) -> None:
        """Goes to a frame of a motion, in a state."""
        self.motion, self.frame = motion, frame
        np.copyto(self.z, z)

    @property
    def next(self) -> int:
        """The frame after the present one."""
        return self.motion.course.after(self.frame)

    def step(self, frame: int) -> None:
        """Goes on to a frame whose phase is near the present one."""
        motion, z = self.motion, self.z
        piece = motion.course.piece[frame]
        if piece != motion.course.piece[self.frame]:
            np.dot(motion.hand_on[piece], z, out=self._handed)
            np.add(self._handed, motion.shift[piece], out=z)
        self._before[...] = z
        self._given[...] = motion.inputs[frame]
        if motion.driving is not None:
            self._given[-1] = self.level
        np.dot(motion.drive[piece], self._input, out=self.hidden)
        np.tanh(self.hidden, out=self.hidden)
        np.dot(motion.project[piece], self.hidden, out=z)
        np.subtract(z, motion.offset[piece], out=z)
        self.frame = frame

    def read(self, out: Float32) -> None:
        """Writes the channels of the present state into out, shape (C,)."""
        np.dot(self.motion.readout[self.motion.course.piece[self.frame]], self._state, out=out)


class PhaseConceptorNetwork:
    """Plays phase-driven motions frame by frame; fits `base.PhaseNetwork`.

    Args:
        scales, seed: what the shared weights were drawn with.
        normalisation: between the normalised channels that W_in knows and the encoding's units.
        motions: what it plays.
    """

    def __init__(
        self, scales: PhaseScales, seed: int, normalisation: Normalisation, motions: dict[str, PhaseMotion]
    ) -> None:
        self.scales, self.seed, self.normalisation = scales, seed, normalisation
        self._of = motions
        self.motions = tuple(motions)
        first = motions[self.motions[0]]
        self.channels = first.readout.shape[1]
        self._frame = np.zeros(self.channels, dtype=np.float32)
        self._values: dict[str, float] = {}  # of the inputs that were set
        self._voice = PhaseVoice(first, 0, first.states[0], first.usual)

    def __getitem__(self, motion: str) -> PhaseMotion:
        if motion not in self._of:
            raise UnknownNameError.among("motion", motion, self.motions)
        return self._of[motion]

    def twin(self) -> PhaseConceptorNetwork:
        """The same weights with a state of its own: what one player does, another does not see."""
        return PhaseConceptorNetwork(self.scales, self.seed, self.normalisation, self._of)

    def with_motions(self, more: dict[str, PhaseMotion]) -> PhaseConceptorNetwork:
        """The same reservoir with further motions."""
        return PhaseConceptorNetwork(self.scales, self.seed, self.normalisation, self._of | more)

    @property
    def inputs(self) -> dict[str, tuple[float, float]]:
        """The inputs that motions have besides the phase, and between which values each was learned."""
        found: dict[str, tuple[float, float]] = {}
        for motion in self._of.values():
            if (driving := motion.driving) is not None:
                least, most = found.get(driving.name, (np.inf, -np.inf))
                found[driving.name] = min(least, driving.values[0]), max(most, driving.values[-1])
        return found

    def set_input(self, name: str, value: float) -> None:
        """Gives an input another value, from the next step on; beyond what a motion was learned at, its end counts.

        Raises:
            UnknownNameError: if no motion has such an input.
        """
        if name not in self.inputs:
            raise UnknownNameError.among("input", name, tuple(self.inputs))
        self._values[name] = value
        self._voice.level = self._level_of(self._voice.motion)

    @property
    def pace(self) -> float:
        """How many frames are played in the time of one, because of the input."""
        driving = self._voice.motion.driving
        return driving.pace(self._voice.level) if driving is not None else 1.0

    def _level_of(self, motion: PhaseMotion) -> float:
        """Of the input of a motion, at its present value."""
        if motion.driving is None:
            return 0.0
        return motion.driving.level(self._values.get(motion.driving.name, motion.driving.usual))

    def _place(self, motion: PhaseMotion, frame: int) -> None:
        """Goes to a frame of a motion, in the state that it settles in there with the present input."""
        self._voice.level = self._level_of(motion)
        self._voice.place(motion, frame, motion.state_at(frame, self._voice.level))

    @property
    def neurons(self) -> int:
        """How many neurons the reservoir has."""
        return self.scales.neurons

    @property
    def activation(self) -> Float32:
        """The activation of the neurons in the last step, shape (N,); the next step overwrites it."""
        return self._voice.hidden

    def anchors(self, motion: str) -> Channels:
        """The frames at the anchors of a motion, shape (anchors, channels)."""
        return self.settled(motion, ANCHOR_EVERY)

    def settled(self, motion: str, every: int = 1) -> Channels:
        """Every so manyth frame of a motion as it is played once it has settled, shape (frames, channels)."""
        part = self[motion]
        return read_settled(part.readout, part.states, part.course, every)

    def recall(self, motion: str) -> Channels:
        """What the readout makes of the stored states; here that is what the anchors are."""
        return self.anchors(motion)

    def cue(self, motion: str, anchor: int) -> None:
        """Goes to an anchor; the next `advance` gives the frame after it."""
        self._place(self[motion], anchor * ANCHOR_EVERY)

    def advance(self, out: Channels) -> None:
        """Steps one frame on and writes it into out, shape (channels,)."""
        self._voice.step(self._voice.next)
        self._voice.read(self._frame)
        out[...] = self._frame

    def retreat(self, out: Channels) -> None:
        """Steps one frame back, along the states that the motion settles in, and writes it into out."""
        part = self._voice.motion
        self._place(part, part.course.preceding(self._voice.frame))
        self._voice.read(self._frame)
        out[...] = self._frame

    @property
    def phase(self) -> float:
        """How far the motion is: [0, 1) in a loop, 0 to 1 in a one-shot."""
        return self._voice.motion.course.share_at(self._voice.frame)

    def seek(self, motion: str, phase: float) -> None:
        """Goes to the frame nearest to a phase, in the state that the motion settles in there."""
        part = self[motion]
        self._place(part, part.course.frame_at(phase))

    def snapshot(self) -> tuple[PhaseMotion, int, Float32, dict[str, float]]:
        """A copy of the state."""
        return self._voice.motion, self._voice.frame, self._voice.z.copy(), dict(self._values)

    def restore(self, snapshot: Any) -> None:
        """Puts the state back to a snapshot."""
        motion, frame, z, self._values = *snapshot[:3], dict(snapshot[3])
        self._voice.level = self._level_of(motion)
        self._voice.place(motion, frame, z)
