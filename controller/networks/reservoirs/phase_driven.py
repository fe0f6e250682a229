"""The base of networks that a phase drives: a motion, its player, and the network around both.

A kind of network adds how its stored arrays become weights, and how its player steps. Phase, pieces and tempo are those
of `phase_reservoir`. One step is one frame's worth of phase: tempo is the number of steps a second, and never changes
what is played. The phase is given and cannot be lost, so noise disturbs the neurons alone.

A motion may have an input u besides the phase (`storage.DrivingInput`): W_u u is added within tanh.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array, Indices
from controller.networks.base import Channels, Float32, PhaseNetwork, ReservoirNetwork
from controller.networks.reservoirs.phase_reservoir import ANCHOR_EVERY, SETTLING_STEPS, PhaseCourse, PhaseReservoir
from controller.networks.storage import LEVELS, DrivingInput, MotionHeader, PhaseScales, StoredNetwork, arrays_of
from motiondeck_base.arrays_on_disk import release
from motiondeck_base.errors import UnknownNameError

# Steps after the end of a one-shot, of which every HELD_EVERY-th counts for the readout of the pose that it holds.
HELD_STEPS, HELD_EVERY = 600, 10


class PhaseMotion(ABC):
    """One motion of T frames in P pieces, ready to be played."""

    # Of each piece, in the units of the encoding, what is added in the last column, shape (P, C, k + 1).
    readout: Float32
    made: ClassVar[tuple[str, ...]] = ("states", "by_level")  # what is computed from the stored arrays once it is used

    def __init__(
        self, stored: Any, course: PhaseCourse, reservoir: PhaseReservoir, driving: DrivingInput | None = None
    ) -> None:
        self.stored, self.readout = stored, stored.readout
        self.readers = [piece.T for piece in self.readout]  # views, made once and not in a step
        self.course, self.reservoir, self.driving = course, reservoir, driving
        # The level of its input while none is given.
        self.usual = driving.level(driving.usual) if driving is not None else 0.0

    def __len__(self) -> int:
        return len(self.course.phase)

    @abstractmethod
    def player(self, frame: int, state: Float32, level: float, runs: tuple[int, ...] = ()) -> PhasePlayer[Any]:
        """A player at a frame, in a state, the input at a level; of several runs with a leading shape."""

    def state_at(self, frame: int, level: float) -> Float32:
        """The state that the motion settles in at a frame, with its input at a level."""
        if self.driving is None:
            return self.states[frame]
        place = float(np.interp(level, LEVELS, np.arange(len(LEVELS))))
        below = min(int(place), len(LEVELS) - 2)
        share = np.float32(place - below)
        return (1 - share) * self.by_level[below, frame] + share * self.by_level[below + 1, frame]

    @cached_property
    def states(self) -> Float32:
        """The states in which it settles at each frame, shape (T, k)."""
        return self.settled_at(self.usual)

    @cached_property
    def by_level(self) -> Float32:
        """The same at each of LEVELS, shape (L, T, k), of a motion with an input."""
        return np.stack([self.settled_at(level) for level in LEVELS])

    def rest(self) -> None:
        """Frees what was computed from the stored arrays; it is computed again when it is used."""
        for name in self.made:
            vars(self).pop(name, None)

    def settled_at(self, level: float) -> Float32:
        """The states that the motion is led to from wherever it starts, its input at a level, shape (T, k)."""
        states = np.zeros((len(self), self.readout.shape[2] - 1), dtype=np.float32)
        before = np.arange(-SETTLING_STEPS, 0)
        lead_in = [*(before % len(self) if self.course.loop else before).tolist(), 0]
        player = self.player(lead_in[0], states[0], level)
        for frame in lead_in[1:]:
            player.step(frame)
        states[0] = player.state
        for frame in range(1, len(self)):
            player.step(frame)
            states[frame] = player.state
        return states

    def reading_with(self, readout: Float32) -> Self:
        """The motion with another readout, in the units of the encoding, shape (P, C, k + 1)."""
        return type(self)(replace(self.stored, readout=readout), self.course, self.reservoir, self.driving)

    def settled_frames(self, frames: Array) -> tuple[Float32, Array, Indices]:
        """The states in which it settles at its frames (T, C) and after the end of a one-shot; frames and pieces."""
        states, piece = self.states, self.course.piece
        if self.course.loop:
            return states, frames, piece
        # The end may settle slowly, or in another state than the one in which it was learned.
        later = self.held_on(HELD_STEPS)[HELD_EVERY - 1 :: HELD_EVERY]
        held = np.repeat(frames[-1:], len(later), axis=0)
        pieces = np.concatenate([piece, np.repeat(piece[-1:], len(later))])
        return np.concatenate([states, later]), np.concatenate([frames, held]), pieces

    def held_on(self, steps: int) -> Float32:
        """The states of a one-shot that goes on holding its end, shape (steps, k)."""
        player = self.player(len(self) - 1, self.states[-1], self.usual)
        states = np.empty((steps, self.states.shape[1]), dtype=np.float32)
        for state in states:
            player.step(len(self) - 1)
            state[:] = player.state
        return states

    def read(self, every: int = 1) -> Channels:
        """Every n-th frame as its settled states are read out, shape (frames, C)."""
        frames = np.arange(0, len(self), every)
        out = np.empty((len(frames), self.readout.shape[1]))
        for piece, own in enumerate(self.readout.astype(np.float64)):
            mine = self.course.piece[frames] == piece
            out[mine] = self.states[frames[mine]] @ own[:, :-1].T + own[:, -1]
        return out


Motion = TypeVar("Motion", bound=PhaseMotion)


class PhasePlayer(ABC, Generic[Motion]):
    """A motion while it plays, its input at a level; all runs are at one frame."""

    def __init__(self, motion: Motion, frame: int, state: Float32, level: float, runs: tuple[int, ...] = ()) -> None:
        # The state and a 1 side by side, for the readout.
        self._extended = np.ones((*runs, state.shape[-1] + 1), dtype=np.float32)
        self.state = self._extended[..., :-1]  # shape (*runs, k)
        # Of the neurons in the last step.
        self.activation = np.zeros((*runs, len(motion.reservoir.bias)), dtype=np.float32)
        self.level = level
        self.place(motion, frame, state)

    def place(self, motion: Motion, frame: int, state: Float32) -> None:
        self.motion, self.frame = motion, frame
        np.copyto(self.state, state)

    @property
    def next(self) -> int:
        return self.motion.course.after(self.frame)

    @abstractmethod
    def step(self, frame: int, noise: Float32 | None = None) -> None:
        """Goes on to a frame whose phase is near the present one; noise (*runs, N) is added to the new state."""

    @abstractmethod
    def displace(self, noise: Float32) -> None:
        """Adds noise (*runs, N) to the present state."""

    def read(self, out: Float32) -> None:
        """Writes the channels of the present state into out, shape (*runs, C)."""
        self._extended.dot(self.motion.readers[self.motion.course.piece[self.frame]], out)


class PhaseDrivenNetwork(ReservoirNetwork[Motion]):
    """Plays phase-driven motions frame by frame; fits `base.PhaseNetwork`."""

    def __init__(
        self,
        scales: PhaseScales,
        seed: int,
        normalisation: Normalisation,
        motions: dict[str, Motion],
        runs: tuple[int, ...] = (),
    ) -> None:
        first = next(iter(motions.values()))
        super().__init__(motions, scales.neurons, first.readout.shape[1], runs)
        self.scales, self.seed, self.normalisation = scales, seed, normalisation
        self.reservoir = first.reservoir
        self._values: dict[str, float] = {}  # of the inputs that were set
        state = np.zeros(first.readout.shape[2] - 1, dtype=np.float32)
        self._player: PhasePlayer[Motion] = first.player(0, state, first.usual, runs)
        self.activation = self._player.activation

    def with_motions(self, more: dict[str, Motion], runs: tuple[int, ...] = ()) -> Self:
        return type(self)(self.scales, self.seed, self.normalisation, self._of | more, runs)

    def only(self, motions: Collection[str]) -> Self:
        return type(self)(self.scales, self.seed, self.normalisation, {name: self[name] for name in motions})

    @property
    def as_phase_network(self) -> PhaseNetwork:
        return self

    def rest(self) -> None:
        for motion in self._of.values():
            motion.rest()
        release()

    @property
    def inputs(self) -> dict[str, tuple[float, float]]:
        """The inputs besides the phase, each with the least and the largest value that was learned."""
        found: dict[str, tuple[float, float]] = {}
        for motion in self._of.values():
            if (driving := motion.driving) is not None:
                least, most = found.get(driving.name, (np.inf, -np.inf))
                found[driving.name] = min(least, driving.values[0]), max(most, driving.values[-1])
        return found

    def set_input(self, name: str, value: float) -> None:
        """Sets an input from the next step on, within the learned values. UnknownNameError if no motion has it."""
        UnknownNameError.check("input", name, self.inputs)
        self._values[name] = value
        self._player.level = self._level_of(self._player.motion)

    @property
    def pace(self) -> float:
        """Rate factor implied by the input: frames played in the time of one."""
        driving = self._player.motion.driving
        return driving.pace(self._player.level) if driving is not None else 1.0

    def _level_of(self, motion: Motion) -> float:
        if motion.driving is None:
            return 0.0
        return motion.driving.level(self._values.get(motion.driving.name, motion.driving.usual))

    def _place(self, motion: Motion, frame: int) -> None:
        self._player.level = self._level_of(motion)
        self._player.place(motion, frame, motion.state_at(frame, self._player.level))

    def anchors(self, motion: str) -> Channels:
        return self[motion].read(ANCHOR_EVERY)

    def settled(self, motion: str) -> Channels:
        return self[motion].read()

    def moving(self, motion: str) -> Channels:
        """The same without the last pose of a one-shot, which it holds."""
        frames = self.settled(motion)
        return frames[: len(frames) - self[motion].course.held]

    def period(self, motion: str) -> int:
        """Frames of a round of a loop, or until the phase of a one-shot is 1."""
        part = self[motion]
        return len(part) if part.course.loop else max(1, len(part) - part.course.held - 1)

    def cue(self, motion: str, anchor: int) -> None:
        self._place(self[motion], anchor * ANCHOR_EVERY)

    def advance(self, out: Channels, noise: Float32 | None = None) -> None:
        self._player.step(self._player.next, noise)
        self._player.read(self._frame)
        out[...] = self._frame

    def displace(self, noise: Float32, weights: Float32 | None = None) -> None:
        self._player.displace(noise)

    def retreat(self, out: Channels) -> None:
        """Steps one frame back, along the settled states of the motion, and writes it into out."""
        part = self._player.motion
        self._place(part, part.course.preceding(self._player.frame))
        self._player.read(self._frame)
        out[...] = self._frame

    @property
    def phase(self) -> float:
        """The share of the motion that is played: [0, 1) in a loop, 0 to 1 in a one-shot, which then holds its end."""
        return self._player.motion.course.share_at(self._player.frame)

    def seek(self, motion: str, phase: float) -> None:
        """Goes to the frame nearest to a phase, in the settled state there; `advance` gives the frame after it."""
        part = self[motion]
        self._place(part, part.course.frame_at(phase))

    def snapshot(self) -> tuple[Motion, int, Float32, dict[str, float]]:
        return self._player.motion, self._player.frame, self._player.state.copy(), dict(self._values)

    def restore(self, snapshot: Any) -> None:
        motion, frame, state, self._values = *snapshot[:3], dict(snapshot[3])
        self._player.level = self._level_of(motion)
        self._player.place(motion, frame, state)

    def driving(self, motion: str) -> DrivingInput | None:
        return self[motion].driving

    def center_phases(self, motion: str) -> Array:
        return np.array([[0.0], [self[motion].course.whole]])

    def arrays(self) -> dict[str, NDArray[Any]]:
        found = arrays_of(self.normalisation, "")
        for name in self.motions:
            part, at = self[name], f"motion/{name}/"
            found |= arrays_of(part.stored, at) | {at + "held": np.array([part.course.held], dtype=np.int32)}
            if part.course.turn:
                found[at + "turn"] = np.array([part.course.turn])
        return found

    def header_fields(self) -> dict[str, Any]:
        return {"scales": self.scales}

    @classmethod
    def load(cls, stored: StoredNetwork) -> Self:
        header, normalisation = stored.header, cls.load_normalisation(stored)
        if (scales := header.scales) is None:
            raise stored.error("its header has no scales for the weights that its motions share")
        reservoir = PhaseReservoir.draw(scales, stored.channels, header.seed)
        sizes = {"c": stored.channels, "n": scales.neurons}
        return cls(scales, header.seed, normalisation, cls.load_motions(stored, sizes, reservoir))

    @classmethod
    def load_normalisation(cls, stored: StoredNetwork) -> Normalisation:
        return stored.normalisation()

    @classmethod
    def load_motions(cls, stored: StoredNetwork, sizes: dict[str, int], reservoir: PhaseReservoir) -> dict[str, Motion]:
        """The motions of a file; `sizes` are those that all motions share."""
        return {motion.name: cls.load_motion(stored, motion, sizes, reservoir) for motion in stored.header.motions}

    @classmethod
    @abstractmethod
    def load_motion(
        cls, stored: StoredNetwork, motion: MotionHeader, sizes: dict[str, int], reservoir: PhaseReservoir
    ) -> Motion:
        """One motion of a file."""


def stored_course(stored: StoredNetwork, motion: MotionHeader, pieces: int) -> PhaseCourse:
    """The phase of a stored motion of P pieces; FileFormatError if pieces and frames do not fit each other."""
    at = f"motion/{motion.name}/"
    held = int(stored.stored.take(at + "held", 1, kind=np.int32)[0])
    if not 0 <= held < motion.frames or pieces > motion.frames:
        raise stored.error(f"'{at}': {pieces} pieces, {held} frames held, of {motion.frames} frames")
    assert stored.header.scales is not None
    leads_in = stored.header.scales.leads_in
    course = PhaseCourse.of(motion.frames, pieces, loop=motion.plays == "loop", held=held, leads_in=leads_in)
    if at + "turn" not in stored.stored:
        return course
    return replace(course, turn=float(stored.stored.take(at + "turn", 1, kind=np.float64)[0]))
