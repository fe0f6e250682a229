"""Learning in a phase-driven reservoir: what both networks have in common.

Because the phase says where in the motion a state belongs, the network that plays can be laid beside the recording
frame by frame, and its readouts are learned from what it really does. Nothing of one motion depends on another.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from controller.learning.preparation.training_motion import TrainingMotion
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork, PhaseMotion
from controller.networks.reservoirs.phase_reservoir import (
    ANCHOR_EVERY,
    Float32,
    PhaseCourse,
    PhaseReservoir,
    PhaseScales,
)
from controller.networks.ridge import ridge

# Frames on either side of a seam and what they count for a readout, so that both pieces meet there.
SEAM_FRAMES, SEAM_WEIGHT = 3, 100.0

# A piece of fewer says nothing about its directions; only series of a few frames a second come so low.
FEWEST_PIECE_FRAMES = 8

Motion = TypeVar("Motion", bound=PhaseMotion)


class PhaseDrivenRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The parameters that both phase-driven networks have.

    Attributes:
        plays: the network that it is for.
        sizes: parameters of networks of rising size; what is stored grows by about 1.4 from one to the next.
        neurons: N.
        harmonics: H of the phase.
        spectral_radius: of W.
        phase_scale, bias_scale: of W_phi and b.
        piece_seconds: about how long the pieces are that a motion is cut into, s.
        ridge: gamma of all regressions.
        drive_scale: of W_u, where a motion has an input besides the phase.
        tolerance_mm: with it, the size is the smallest with which no motion is further off, mm.
    """

    plays: ClassVar[type[PhaseDrivenNetwork[Any]]]
    sizes: ClassVar[tuple[dict[str, int], ...]]

    neurons: int
    harmonics: int
    spectral_radius: float
    phase_scale: float = 3.0
    bias_scale: float = 0.8
    piece_seconds: float = 1.5
    ridge: float = 1e-3
    drive_scale: float = 1.0
    tolerance_mm: float | None = None

    @property
    def anchor_every(self) -> int:
        """Frames between the states that a motion can be entered at."""
        return ANCHOR_EVERY

    def scales(self, *, driven: bool) -> PhaseScales:
        """What the shared weights are drawn with; driven, if a motion has an input besides the phase."""
        return PhaseScales(
            self.neurons,
            self.harmonics,
            self.spectral_radius,
            0.0,
            self.phase_scale,
            self.bias_scale,
            self.drive_scale if driven else 0.0,
        )

    def learn(
        self, motion: TrainingMotion, reservoir: PhaseReservoir, normalisation: Normalisation, rate: float
    ) -> PhaseMotion:
        """One motion in a reservoir."""
        raise NotImplementedError


def train_phase_driven(
    to_learn: list[TrainingMotion], normalisation: Normalisation, recipe: PhaseDrivenRecipe, rate: float, seed: int
) -> PhaseDrivenNetwork[Any]:
    """One network that holds all motions.

    Args:
        to_learn: the motions.
        normalisation: between their channels and the encoding's units.
        recipe: which network, its sizes and scales.
        rate: frames per second.
        seed: of everything random.
    """
    scales = recipe.scales(driven=any(one.driving is not None for one in to_learn))
    reservoir = PhaseReservoir.draw(scales, to_learn[0].frames.shape[1], seed)
    motions = {one.name: recipe.learn(one, reservoir, normalisation, rate) for one in to_learn}
    return recipe.plays(scales, seed, normalisation, motions)


def course_of(motion: TrainingMotion, piece_frames: float) -> PhaseCourse:
    """How the center turns with a motion that is cut into pieces of about so many frames; one with an input is one."""
    frames, piece_frames = len(motion.frames), max(piece_frames, FEWEST_PIECE_FRAMES)
    if motion.driving is not None:
        return PhaseCourse.of(frames, 1, loop=True)
    if not motion.loop:
        held = _frames_held(motion.frames)
        return PhaseCourse.of(frames, max(1, round((frames - held) / piece_frames)), loop=False, held=held)
    # A loop of half turns closes after an even number of them.
    pieces = 2 * round(0.5 * frames / piece_frames)
    return PhaseCourse.of(frames, max(1, pieces), loop=True)


def _frames_held(frames: Array) -> int:
    """How many frames at the end repeat the one before them."""
    moving = np.flatnonzero((np.diff(frames, axis=0) != 0.0).any(1))
    return len(frames) - 1 - (int(moving[-1]) + 1) if len(moving) else len(frames) - 2


def with_readouts(unread: Motion, motion: TrainingMotion, normalisation: Normalisation, regulariser: float) -> Motion:
    """A motion that reads its channels out of the states in which it settles, at each value of its input.

    Args:
        unread: the motion without a readout.
        motion: what it was learned from.
        normalisation: between those frames and the encoding's units.
        regulariser: of the ridge regressions.
    """
    states, frames, piece = unread.states, motion.frames, unread.course.piece
    if (driving := motion.driving) is not None:
        states = np.concatenate([unread.settled_at(driving.level(variant.value)) for variant in motion.variants])
        frames = np.concatenate([variant.frames for variant in motion.variants])
        piece = np.tile(piece, len(motion.variants))
    readout = learn_readouts(states, piece, normalisation.invert(frames), regulariser)
    return type(unread)(replace(unread.stored, readout=readout), unread.course, unread.reservoir, driving)


def learn_readouts(states: Float32, piece: NDArray[np.int64], frames: Array, regulariser: float) -> Float32:
    """A readout for each piece of a motion, from the states in which the network settles, frame by frame.

    Args:
        states: at each frame, shape (T, k).
        piece: that each frame belongs to, shape (T,).
        frames: to be read, shape (T, C).
        regulariser: of the ridge regressions.

    Returns:
        (R, r) of each piece, shape (P, C, k + 1).
    """
    pieces = [np.flatnonzero(piece == one) for one in range(int(piece.max()) + 1)]
    weight = np.ones(len(frames))
    for own in pieces if len(pieces) > 1 else []:
        weight[own[:SEAM_FRAMES]] = weight[own[-SEAM_FRAMES:]] = SEAM_WEIGHT
    found = [affine_ridge(states[own].astype(np.float64), frames[own], regulariser, weight[own]) for own in pieces]
    # As a file has them, so that a loaded network plays the same bit by bit.
    return np.ascontiguousarray(np.stack(found))


def affine_ridge(states: Array, targets: Array, regulariser: float, weight: Array | None = None) -> Float32:
    """(W, w) with targets ~ W states + w, rows counting by their weight, the constant free, shape (C, k + 1)."""
    centre, middle = (np.average(a, axis=0, weights=weight) for a in (states, targets))
    root = 1.0 if weight is None else np.sqrt(weight)[:, None]
    weights = ridge(root * (states - centre), root * (targets - middle), regulariser)
    return np.column_stack([weights, middle - weights @ centre]).astype(np.float32)
