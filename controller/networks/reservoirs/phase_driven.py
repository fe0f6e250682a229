"""The base of networks that a center drives: a motion, the voice that plays it, and the network around both.

What belongs to one kind of network alone is how its stored arrays become weights, and how a voice steps. Phase, pieces
and tempo are those of `phase_reservoir`. One step is one frame's worth of phase: tempo is how many steps are made a
second, and never changes what is played.

A motion may have an input u besides the phase (`driving_input`): W_u u is added within tanh.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Generic, Self, TypeVar

import numpy as np

from controller.motion.encodings.normalisation import Normalisation
from controller.networks.base import Channels
from controller.networks.reservoirs.driving_input import LEVELS, DrivingInput
from controller.networks.reservoirs.phase_reservoir import (
    ANCHOR_EVERY,
    SETTLING_STEPS,
    Float32,
    PhaseCourse,
    PhaseReservoir,
    PhaseScales,
)
from controller.networks.reservoirs.reservoir_network import ReservoirNetwork
from motiondeck_base.errors import UnknownNameError


class PhaseMotion(ABC):
    """One motion of T frames in P pieces, ready to be played.

    Args:
        stored: what a library keeps of it, a dataclass of arrays, its readout among them.
        course: of its phase.
        reservoir: the weights that it shares with others.
        driving: its input besides the phase, if it has one.

    Attributes:
        readout: of each piece, in the units of the encoding, what is added in the last column, shape (P, C, k + 1).
        usual: the level of its input while none is given.
        states: at each frame once the network has settled, shape (T, k).
        by_level: the same at each of LEVELS, shape (L, T, k), of a motion with an input.
    """

    readout: Float32
    states: Float32
    by_level: Float32

    def __init__(
        self,
        stored: Any,
        course: PhaseCourse,
        reservoir: PhaseReservoir,
        driving: DrivingInput | None = None,
    ) -> None:
        self.stored, self.readout = stored, stored.readout
        self.course, self.reservoir, self.driving = course, reservoir, driving
        self.usual = driving.level(driving.usual) if driving is not None else 0.0

    def __len__(self) -> int:
        return len(self.course.phase)

    @abstractmethod
    def voice(self, frame: int, state: Float32, level: float) -> PhaseVoice[Any]:
        """What plays it from a frame on, in a state, its input at a level."""

    def state_at(self, frame: int, level: float) -> Float32:
        """The state that the motion settles in at a frame, with its input at a level."""
        if self.driving is None:
            return self.states[frame]
        place = float(np.interp(level, LEVELS, np.arange(len(LEVELS))))
        below = min(int(place), len(LEVELS) - 2)
        share = np.float32(place - below)
        return (1 - share) * self.by_level[below, frame] + share * self.by_level[below + 1, frame]

    def settle(self) -> None:
        """Finds the states in which it settles."""
        self.states = self.settled_at(self.usual)
        levels = LEVELS if self.driving is not None else ()
        self.by_level = np.stack([self.settled_at(level) for level in levels]) if len(levels) else self.states[None]

    def settled_at(self, level: float) -> Float32:
        """The states that the motion is led to from wherever it starts, its input at a level, shape (T, k)."""
        states = np.zeros((len(self), self.readout.shape[2] - 1), dtype=np.float32)
        voice = self.voice(-SETTLING_STEPS % len(self) if self.course.loop else 0, states[0], level)
        for _ in range(SETTLING_STEPS):
            voice.step(voice.next if self.course.loop else 0)
        states[0] = voice.state
        for frame in range(1, len(self)):
            voice.step(frame)
            states[frame] = voice.state
        return states

    def read(self, every: int = 1) -> Channels:
        """Every so manyth frame as its settled states are read out, shape (frames, C)."""
        frames = np.arange(0, len(self), every)
        out = np.empty((len(frames), self.readout.shape[1]))
        for piece, own in enumerate(self.readout.astype(np.float64)):
            mine = self.course.piece[frames] == piece
            out[mine] = self.states[frames[mine]] @ own[:, :-1].T + own[:, -1]
        return out


Motion = TypeVar("Motion", bound=PhaseMotion)


class PhaseVoice(ABC, Generic[Motion]):
    """A motion while it plays.

    Args:
        motion, frame, state: what it plays and where it is.
        neurons: N.
        level: of its input.

    Attributes:
        state: shape (k,).
        activation: of the neurons in the last step, shape (N,).
    """

    def __init__(self, motion: Motion, frame: int, state: Float32, neurons: int, level: float) -> None:
        # The state and a 1 side by side, for the readout.
        self._extended = np.ones(len(state) + 1, dtype=np.float32)
        self.state = self._extended[:-1]
        self.activation = np.zeros(neurons, dtype=np.float32)
        self.level = level
        self.place(motion, frame, state)

    def place(self, motion: Motion, frame: int, state: Float32) -> None:
        """Goes to a frame of a motion, in a state."""
        self.motion, self.frame = motion, frame
        np.copyto(self.state, state)

    @property
    def next(self) -> int:
        """The frame after the present one."""
        return self.motion.course.after(self.frame)

    @abstractmethod
    def step(self, frame: int) -> None:
        """Goes on to a frame whose phase is near the present one."""

    def read(self, out: Float32) -> None:
        """Writes the channels of the present state into out, shape (C,)."""
        np.dot(self.motion.readout[self.motion.course.piece[self.frame]], self._extended, out=out)


class PhaseDrivenNetwork(ReservoirNetwork[Motion]):
    """Plays phase-driven motions frame by frame; fits `base.InputNetwork`.

    Args:
        scales, seed: what the shared weights were drawn with.
        normalisation: between the normalised channels that are learned and the encoding's units.
        motions: what it plays.
    """

    def __init__(
        self, scales: PhaseScales, seed: int, normalisation: Normalisation, motions: dict[str, Motion]
    ) -> None:
        first = next(iter(motions.values()))
        super().__init__(motions, scales.neurons, first.readout.shape[1])
        self.scales, self.seed, self.normalisation = scales, seed, normalisation
        self.reservoir = first.reservoir
        self._values: dict[str, float] = {}  # of the inputs that were set
        self._voice: PhaseVoice[Motion] = first.voice(0, first.states[0], first.usual)
        self.activation = self._voice.activation

    def with_motions(self, more: dict[str, Motion]) -> Self:
        """The same reservoir with further motions."""
        return type(self)(self.scales, self.seed, self.normalisation, self._of | more)

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

    def _level_of(self, motion: Motion) -> float:
        """Of the input of a motion, at its present value."""
        if motion.driving is None:
            return 0.0
        return motion.driving.level(self._values.get(motion.driving.name, motion.driving.usual))

    def _place(self, motion: Motion, frame: int) -> None:
        """Goes to a frame of a motion, in the state that it settles in there with the present input."""
        self._voice.level = self._level_of(motion)
        self._voice.place(motion, frame, motion.state_at(frame, self._voice.level))

    def anchors(self, motion: str) -> Channels:
        """The frames at the anchors of a motion, shape (anchors, channels)."""
        return self[motion].read(ANCHOR_EVERY)

    def settled(self, motion: str) -> Channels:
        """The frames of a motion as it is played once it has settled, shape (frames, channels)."""
        return self[motion].read()

    def moving(self, motion: str) -> Channels:
        """The same without the last pose of a one-shot, which it holds."""
        frames = self.settled(motion)
        return frames[: len(frames) - self[motion].course.held]

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

    def snapshot(self) -> tuple[Motion, int, Float32, dict[str, float]]:
        """A copy of the state."""
        return self._voice.motion, self._voice.frame, self._voice.state.copy(), dict(self._values)

    def restore(self, snapshot: Any) -> None:
        """Puts the state back to a snapshot."""
        motion, frame, state, self._values = *snapshot[:3], dict(snapshot[3])
        self._voice.level = self._level_of(motion)
        self._voice.place(motion, frame, state)
