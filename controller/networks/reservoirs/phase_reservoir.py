"""Shared by phase-driven networks: a reservoir that a center drives, and the phase of the center in a motion.

A loop turns the phase phi round and round. A one-shot turns it by half a turn and stops. A long motion is a chain of
pieces, each half a turn. The reservoir sees phi by its harmonics

    p(phi) = a / sqrt(H) (cos phi, ..., cos H phi, sin phi, ..., sin H phi)

The weights that motions share follow from a seed and are not stored.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from controller.networks.base import Float32
from controller.networks.storage import PhaseScales

ANCHOR_EVERY = 2
SETTLING_STEPS = 100


@dataclass(frozen=True)
class PhaseReservoir:
    """The weights that all motions share, with N neurons, C channels and H harmonics."""

    weights: Float32  # W, shape (N, N)
    input_weights: Float32  # W_in, shape (N, C)
    phase_weights: Float32  # W_phi a / sqrt(H), shape (N, 2 H)
    bias: Float32  # b, shape (N,)
    drive_weights: Float32  # W_u, shape (N, 1), or (N, 0) where there is no input besides the phase

    @classmethod
    def draw(cls, scales: PhaseScales, channels: int, seed: int) -> Self:
        """The weights of a seed, each from U[-1, 1] before it is scaled."""
        # Drawn from the raw bits of the generator, whose stream never changes with the version of numpy.
        raw, neurons, inputs = np.random.PCG64(seed), scales.neurons, 2 * scales.harmonics

        def uniform(scale: float, *shape: int) -> Float32:
            bits = raw.random_raw(int(np.prod(shape))) >> np.uint64(11)
            return (scale * (bits * 2.0**-52 - 1.0)).reshape(shape).astype(np.float32)

        return cls(
            uniform(scales.spectral_radius * np.sqrt(3.0 / neurons), neurons, neurons),
            uniform(scales.input_scale, neurons, channels),
            uniform(scales.phase_scale / np.sqrt(scales.harmonics), neurons, inputs),
            uniform(scales.bias_scale, neurons),
            uniform(scales.drive_scale, neurons, int(scales.drive_scale > 0.0)),
        )

    def harmonics_of(self, phase: NDArray[np.float64]) -> Float32:
        """(cos phi, ..., cos H phi, sin phi, ..., sin H phi) of phases (T,), shape (T, 2 H)."""
        angles = np.multiply.outer(phase, np.arange(1, self.phase_weights.shape[1] // 2 + 1))
        return np.concatenate([np.cos(angles), np.sin(angles)], axis=-1).astype(np.float32)


@dataclass(frozen=True)
class PhaseCourse:
    """The phase of the center in a motion of T frames in P pieces."""

    phase: NDArray[np.float64]  # phi at each frame, shape (T,), rad; it rises, and stays where a one-shot has stopped
    piece: NDArray[np.int64]  # which piece plays each frame, shape (T,)
    loop: bool  # whether frame 0 follows the last one
    leads_in: bool = True  # whether the phase rises before a one-shot begins, so that it begins at its own speed
    turn: float = 0.0  # what is added to phi for the reservoir, rad: loops in step have like poses at like phases

    @classmethod
    def of(cls, frames: int, pieces: int, *, loop: bool, held: int = 0, leads_in: bool = True) -> Self:
        """Of a motion of some frames, the last of which only hold its end."""
        way = np.arange(frames) / (frames if loop else max(1, frames - held - 1))
        piece = np.minimum(pieces * way, pieces - 1).astype(np.int64)
        half_turns = 2 if loop and pieces == 1 else pieces
        return cls(np.pi * half_turns * np.minimum(way, 1.0), piece, loop, leads_in)

    @property
    def held(self) -> int:
        """Frames at the end that hold the last pose."""
        return int((np.diff(self.phase) == 0.0).sum())

    def share_at(self, frame: int) -> float:
        """The phase at a frame as a share: [0, 1) in a loop, 0 to 1 in a one-shot."""
        return float(self.phase[frame] / self.whole)

    def frame_at(self, share: float) -> int:
        """The frame nearest to a share of the way."""
        if self.loop:
            return round(share * len(self.phase)) % len(self.phase)
        return int(np.abs(self.phase - share * self.whole).argmin())

    @cached_property
    def whole(self) -> float:
        """By how much the center turns in a round of a loop, or in all of a one-shot, rad."""
        return float(self.phase[-1] + (self.phase[1] if self.loop else 0.0))

    def before(self, steps: int) -> NDArray[np.float64]:
        """phi in the frames before the first, shape (steps,): a one-shot comes from half a turn before, or stands."""
        phase = float(self.phase[1]) * np.arange(-steps, 0, dtype=np.float64)
        return phase if self.loop else np.maximum(phase, -np.pi if self.leads_in else 0.0)

    @property
    def with_lead_in(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Turned phase and piece of each frame, then of SETTLING_STEPS before a one-shot: frame -1 precedes frame 0."""
        before = np.zeros(SETTLING_STEPS, dtype=np.int64)
        phase = np.concatenate([self.phase, self.before(len(before))]) + self.turn
        return phase, np.concatenate([self.piece, before])

    def after(self, frame: int) -> int:
        """The frame that follows one: the first after the last of a loop, the last itself of a one-shot."""
        if frame + 1 < len(self.phase):
            return frame + 1
        return 0 if self.loop else frame

    def preceding(self, frame: int) -> int:
        """The frame before one: the last before the first of a loop, the first itself of a one-shot."""
        return frame - 1 if frame > 0 else len(self.phase) - 1 if self.loop else 0
