"""A phase-driven echo-state network: a center drives the reservoir, and every motion reads it out for itself.

The reservoir of an echo-state network (Deliallisi 2017, eq. 3.4 with a = 1) is fed the phase phi of a harmonic center
(Vakulenko et al. 2017, eq. 1) instead of its own output:

    x(n+1)  = tanh(W x(n) + W_phi p(phi(n+1)) + b)
    y(n)    = R x(n) + r

W, W_phi and b are drawn from a seed and shared; R and r belong to a motion, or to a piece of a long one. Nothing is fed
back, so with a spectral radius below 1 the state forgets where it began, and with it every disturbance. Phase, pieces
and tempo are those of `phase_reservoir`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from controller.mocap.encodings.normalisation import Normalisation
from controller.networks.base import Channels
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


class PhaseEchoStateMotion:
    """One motion of T frames in P pieces, ready to be played.

    Args:
        readout: (R, r) of each piece, in the units of the encoding, shape (P, C, N + 1).
        course: of its phase.
        reservoir: the weights that it shares with others.

    Attributes:
        driven: W_phi p + b at each frame, shape (T, N).
        states: x at each frame once the network has settled, shape (T, N).
    """

    def __init__(self, readout: Float32, course: PhaseCourse, reservoir: PhaseReservoir) -> None:
        self.readout, self.course = readout, course
        self.driven, self.states = driven_states(course, reservoir)


def driven_states(course: PhaseCourse, reservoir: PhaseReservoir) -> tuple[Float32, Float32]:
    """W_phi p + b at each frame of a course, and the states in which the reservoir settles there, shape (T, N) each."""
    driven = reservoir.harmonics_of(course.phase) @ reservoir.phase_weights.T + reservoir.bias
    states = np.zeros_like(driven)
    x = states[0].copy()
    for step in range(-SETTLING_STEPS, len(driven)):
        frame = step % len(driven) if course.loop else max(step, 0)
        x = np.tanh(reservoir.weights @ x + driven[frame])
        states[frame] = x
    return driven, states


class PhaseEchoStateNetwork:
    """Plays phase-driven motions frame by frame; fits `base.PhaseNetwork`.

    Args:
        scales, seed: what the shared weights were drawn with.
        normalisation: of the channels; kept for motions that are added later.
        motions: what it plays.
    """

    def __init__(
        self, scales: PhaseScales, seed: int, normalisation: Normalisation, motions: dict[str, PhaseEchoStateMotion]
    ) -> None:
        self.scales, self.seed, self.normalisation = scales, seed, normalisation
        self._of = motions
        self.motions = tuple(motions)
        first = motions[self.motions[0]]
        self.channels = first.readout.shape[1]
        self.reservoir = PhaseReservoir.draw(scales, self.channels, seed)
        self._hidden = np.zeros(scales.neurons, dtype=np.float32)
        # x and a 1 side by side, for the readout.
        self._state = np.ones(scales.neurons + 1, dtype=np.float32)
        self._x = self._state[:-1]
        self._out = np.zeros(self.channels, dtype=np.float32)
        self._place(first, 0)

    def __getitem__(self, motion: str) -> PhaseEchoStateMotion:
        if motion not in self._of:
            raise UnknownNameError.among("motion", motion, self.motions)
        return self._of[motion]

    def twin(self) -> PhaseEchoStateNetwork:
        """The same weights with a state of its own: what one player does, another does not see."""
        return self.with_motions({})

    def with_motions(self, more: dict[str, PhaseEchoStateMotion]) -> PhaseEchoStateNetwork:
        """The same reservoir with further motions."""
        return PhaseEchoStateNetwork(self.scales, self.seed, self.normalisation, self._of | more)

    @property
    def neurons(self) -> int:
        """How many neurons the reservoir has."""
        return self.scales.neurons

    @property
    def activation(self) -> Float32:
        """The activation of the neurons in the last step, shape (N,); the next step overwrites it."""
        return self._x

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
        motion = self._motion
        self._frame = motion.course.after(self._frame)
        np.dot(self.reservoir.weights, self._x, out=self._hidden)
        np.add(self._hidden, motion.driven[self._frame], out=self._hidden)
        np.tanh(self._hidden, out=self._x)
        self._read(out)

    def retreat(self, out: Channels) -> None:
        """Steps one frame back, along the states that the motion settles in, and writes it into out."""
        self._place(self._motion, self._motion.course.preceding(self._frame))
        self._read(out)

    @property
    def phase(self) -> float:
        """How far the motion is: [0, 1) in a loop, 0 to 1 in a one-shot."""
        return self._motion.course.share_at(self._frame)

    def seek(self, motion: str, phase: float) -> None:
        """Goes to the frame nearest to a phase, in the state that the motion settles in there."""
        part = self[motion]
        self._place(part, part.course.frame_at(phase))

    def snapshot(self) -> tuple[PhaseEchoStateMotion, int, Float32]:
        """A copy of the state."""
        return self._motion, self._frame, self._x.copy()

    def restore(self, snapshot: Any) -> None:
        """Puts the state back to a snapshot."""
        self._motion, self._frame, x = snapshot
        np.copyto(self._x, x)

    def _place(self, motion: PhaseEchoStateMotion, frame: int) -> None:
        """Goes to a frame of a motion, in the state that it settles in there."""
        self._motion, self._frame = motion, frame
        np.copyto(self._x, motion.states[frame])

    def _read(self, out: Channels) -> None:
        """Writes the channels of the present state into out, shape (channels,)."""
        np.dot(self._motion.readout[self._motion.course.piece[self._frame]], self._state, out=self._out)
        np.copyto(out, self._out)
