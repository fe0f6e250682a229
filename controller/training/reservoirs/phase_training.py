"""Loading motions into a phase-driven reservoir: each piece learns its conceptor, its input and its channels.

The reservoir is driven with the channels and the phase of a motion. A piece then learns from its own states X alone:

    C = R (R + aperture^-2 I)^-1,  R = (X - m)(X - m)' / N,  cut to k directions U    (Deliallisi 2017, eqs 3.9, 3.10)
    V, v: the channels of a frame from the state before it, and
    R, r: the channels of a frame from the state in which the network is when it plays by itself,

both by ridge regression on z = U' (x - m). Because the phase says where in the motion a state belongs, the network that
plays can be laid beside the recording frame by frame, and R is learned from what it really does. Nothing of one motion
depends on another.
"""

from __future__ import annotations

from dataclasses import fields, replace

import msgspec
import numpy as np
from numpy.typing import NDArray

from controller.mocap.encodings.normalisation import Normalisation
from controller.networks.reservoirs.driving_input import DrivingInput
from controller.networks.reservoirs.phase_conceptor import PhaseConceptorNetwork, PhaseMotion, StoredPieces
from controller.networks.reservoirs.phase_reservoir import (
    ANCHOR_EVERY,
    Float32,
    PhaseCourse,
    PhaseReservoir,
    PhaseScales,
)
from controller.networks.reservoirs.reservoir import Reservoir, drive
from controller.ridge import ridge
from controller.rotations import Array
from controller.training.preparation.training_motion import TrainingMotion
from controller.training.reservoirs.conceptor_training import principal_directions

# How long pieces overlap on either side of a seam, and how long the reservoir takes to forget its start, s.
OVERLAP_SECONDS = 0.2
WASHOUT_SECONDS = 0.8

# Frames on either side of a seam and what they count for a readout, so that both pieces meet there.
SEAM_FRAMES, SEAM_WEIGHT = 3, 100.0

# Of W_in, in a network whose motions have inputs: what the channels were at other values must not outvote the input.
DRIVEN_INPUT_SHARE = 0.1


class PhaseRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, tag="phase-conceptor"):
    """The parameters of phase-driven conceptors.

    Attributes:
        neurons: N.
        harmonics: H of the phase.
        spectral_radius: of W.
        input_scale, phase_scale, bias_scale: of W_in, W_phi and b.
        aperture: alpha.
        rank: k, how many directions of a conceptor are kept.
        piece_seconds: about how long the pieces are that a motion is cut into, s.
        ridge: gamma of both regressions.
        drive_scale: of W_u, where a motion has an input besides the phase.
        tolerance_mm: with it, N and k are the smallest of `size_choice.SIZES` with which no motion is further off, mm.
    """

    neurons: int = 300
    harmonics: int = 3
    spectral_radius: float = 1.6
    input_scale: float = 1.0
    phase_scale: float = 3.0
    bias_scale: float = 0.8
    aperture: float = 30.0
    rank: int = 40
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
            self.input_scale * (DRIVEN_INPUT_SHARE if driven else 1.0),
            self.phase_scale,
            self.bias_scale,
            self.drive_scale if driven else 0.0,
        )


def train_phase_conceptors(
    to_learn: list[TrainingMotion], normalisation: Normalisation, recipe: PhaseRecipe, rate: float, seed: int
) -> PhaseConceptorNetwork:
    """One network that holds all motions.

    Args:
        to_learn: the motions.
        normalisation: between their channels and the encoding's units.
        recipe: sizes and scales.
        rate: frames per second.
        seed: of everything random.
    """
    scales = recipe.scales(driven=any(one.driving is not None for one in to_learn))
    reservoir = PhaseReservoir.draw(scales, to_learn[0].frames.shape[1], seed)
    motions = {one.name: learn_motion(one, reservoir, normalisation, recipe, rate) for one in to_learn}
    return PhaseConceptorNetwork(scales, seed, normalisation, motions)


def learn_motion(
    motion: TrainingMotion, reservoir: PhaseReservoir, normalisation: Normalisation, recipe: PhaseRecipe, rate: float
) -> PhaseMotion:
    """One motion in a reservoir."""
    if motion.driving is not None:
        return _learn_driven(motion, motion.driving, reservoir, normalisation, recipe, rate)
    course = course_of(motion, recipe.piece_seconds * rate)
    many = int(course.piece[-1]) + 1
    overlap = 0 if motion.loop and many == 1 else round(OVERLAP_SECONDS * rate)
    states, first = _driven_states(motion, course, reservoir, round(WASHOUT_SECONDS * rate), overlap)
    pieces: list[StoredPieces] = []
    for piece in range(many):
        at = _window(course, piece, overlap)
        inputs = motion.frames[at % len(course.phase) if motion.loop else np.maximum(at, 0)]
        pieces.append(_learn_piece(states[first + at - 1], states[first + at], inputs, recipe))
    stored = StoredPieces(
        *(np.concatenate([getattr(piece, field.name) for piece in pieces]) for field in fields(StoredPieces))
    )
    settled = PhaseMotion(stored, course, reservoir).states
    readout = learn_readouts(settled, course, normalisation.invert(motion.frames), recipe.ridge)
    return PhaseMotion(replace(stored, readout=readout), course, reservoir)


def _learn_driven(
    motion: TrainingMotion,
    driving: DrivingInput,
    reservoir: PhaseReservoir,
    normalisation: Normalisation,
    recipe: PhaseRecipe,
    rate: float,
) -> PhaseMotion:
    """A loop with an input: one conceptor, V and readout for all values that it was recorded at."""
    course, washout = PhaseCourse.of(len(motion.frames), 1, loop=True), round(WASHOUT_SECONDS * rate)
    before, after = [], []
    for variant in motion.variants:
        one = TrainingMotion(motion.name, variant.frames, loop=True)
        states, first = _driven_states(one, course, reservoir, washout, 0, driving.level(variant.value))
        before.append(states[first - 1 : -1])
        after.append(states[first:])
    frames = np.concatenate([variant.frames for variant in motion.variants])
    stored = _learn_piece(np.concatenate(before), np.concatenate(after), frames, recipe)
    alone = PhaseMotion(stored, course, reservoir, driving)
    settled = [alone.settled_at(driving.level(variant.value)) for variant in motion.variants]
    readout = _affine_ridge(np.concatenate(settled).astype(np.float64), normalisation.invert(frames), recipe.ridge)
    return PhaseMotion(replace(stored, readout=readout[None]), course, reservoir, driving)


def course_of(motion: TrainingMotion, piece_frames: float) -> PhaseCourse:
    """How the center turns with a motion that is cut into pieces of about so many frames."""
    frames = len(motion.frames)
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


def _driven_states(
    motion: TrainingMotion,
    course: PhaseCourse,
    reservoir: PhaseReservoir,
    washout: int,
    overlap: int,
    level: float = 0.0,
) -> tuple[Array, int]:
    """The states that a motion leaves in the reservoir, and which of them belongs to its first frame."""
    channels, phase = [motion.lead_in(washout), motion.frames], [course.before(washout), course.phase]
    if motion.loop:
        channels.append(motion.frames[:overlap])
        phase.append(course.phase[:overlap])
    inputs = np.hstack([reservoir.input_weights, reservoir.phase_weights])
    bias = reservoir.bias + level * reservoir.drive_weights.sum(1)
    signal = np.hstack([np.concatenate(channels), reservoir.harmonics_of(np.concatenate(phase))])
    (states,) = drive(Reservoir(reservoir.weights, inputs, bias), [signal.astype(np.float64)])
    return states.astype(np.float64), len(channels[0])


def _window(course: PhaseCourse, piece: int, overlap: int) -> NDArray[np.int64]:
    """The frames that a piece learns from, its own and the overlap; those below 0 lie before the motion."""
    own = np.flatnonzero(course.piece == piece)
    last = own[-1] + overlap
    return np.arange(own[0] - overlap, 1 + (last if course.loop else min(last, len(course.phase) - 1)))


def _learn_piece(before: Array, states: Array, inputs: Array, recipe: PhaseRecipe) -> StoredPieces:
    """A piece from the states (T, N) before and after its inputs (T, C); its readout is not learned yet."""
    # What follows is learned with the mean and the directions as they are stored.
    mean = states.mean(0).astype(np.float16)
    values, directions = principal_directions(states - mean, recipe.rank)
    kept = np.zeros((len(mean), recipe.rank), dtype=np.float16)
    kept[:, : len(values)] = directions
    strength = np.zeros(recipe.rank, dtype=np.float32)
    strength[: len(values)] = values / (values + recipe.aperture**-2)
    estimate = _affine_ridge((before - mean) @ kept.astype(np.float64), inputs, recipe.ridge)
    unread = np.zeros_like(estimate)
    return StoredPieces(kept[None], strength[None], mean[None], estimate.astype(np.float16)[None], unread[None])


def learn_readouts(states: Float32, course: PhaseCourse, frames: Array, regulariser: float) -> Float32:
    """A readout for each piece of a motion, from the states in which the network settles, frame by frame.

    Args:
        states: at each frame, shape (T, k).
        course: of the phase.
        frames: to be read, shape (T, C).
        regulariser: of the ridge regressions.

    Returns:
        (R, r) of each piece, shape (P, C, k + 1).
    """
    pieces = [np.flatnonzero(course.piece == piece) for piece in range(int(course.piece[-1]) + 1)]
    weight = np.ones(len(frames))
    for own in pieces if len(pieces) > 1 else []:
        weight[own[:SEAM_FRAMES]] = weight[own[-SEAM_FRAMES:]] = SEAM_WEIGHT
    found = [_affine_ridge(states[own].astype(np.float64), frames[own], regulariser, weight[own]) for own in pieces]
    # As a file has them, so that a loaded network plays the same bit by bit.
    return np.ascontiguousarray(np.stack(found))


def _affine_ridge(states: Array, targets: Array, regulariser: float, weight: Array | None = None) -> Float32:
    """(W, w) with targets ~ W states + w, rows counting by their weight, the constant free, shape (C, k + 1)."""
    centre, middle = (np.average(a, axis=0, weights=weight) for a in (states, targets))
    root = 1.0 if weight is None else np.sqrt(weight)[:, None]
    weights = ridge(root * (states - centre), root * (targets - middle), regulariser)
    return np.column_stack([weights, middle - weights @ centre]).astype(np.float32)
