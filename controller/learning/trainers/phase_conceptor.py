"""Trains phase-driven conceptors: each piece of a motion learns its conceptor, its input and its channels.

The reservoir is driven with the channels and the phase of a motion. A piece then learns from its own states X alone:

    C = R (R + aperture^-2 I)^-1,  R = (X - m)(X - m)' / N,  cut to k directions U    (Deliallisi 2017, eqs 3.9, 3.10)
    V, v: the channels of a frame from the state before it, and
    R, r: the channels of a frame from the state of the network when it plays by itself,

both by ridge regression on z = U' (x - m).
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import msgspec
import numpy as np

from controller.learning.preparation.training_motion import TrainingMotion
from controller.learning.reservoirs.conceptor_training import principal_directions
from controller.learning.trainers.phase_driven import PhaseDrivenRecipe, PhaseDrivenTrainer, course_of
from controller.motion.rotations import Array, Indices
from controller.networks.phase_conceptor.network import PhaseConceptorMotion, PhaseConceptorNetwork, StoredPieces
from controller.networks.reservoirs.phase_reservoir import Float32, PhaseCourse, PhaseReservoir, PhaseScales
from controller.networks.reservoirs.reservoir import Reservoir, drive
from controller.networks.ridge import affine_ridge
from motiondeck_base.arrays_on_disk import on_disk

# Overlap of pieces on either side of a seam, and washout of the reservoir, s.
OVERLAP_SECONDS = 0.2
WASHOUT_SECONDS = 0.8

# Of W_in, if motions have inputs: channels at other values of the input must not dominate it.
DRIVEN_INPUT_SHARE = 0.1


class PhaseRecipe(PhaseDrivenRecipe, frozen=True, kw_only=True, tag="phase-conceptor"):
    """The parameters of phase-driven conceptors."""

    neurons: int = 300
    harmonics: int = 3
    spectral_radius: float = 1.6
    input_scale: float = 1.0  # of W_in
    aperture: float = 30.0  # alpha
    rank: int = 40  # k, number of directions kept of a conceptor

    def scales(self, *, driven: bool) -> PhaseScales:
        share = DRIVEN_INPUT_SHARE if driven else 1.0
        return msgspec.structs.replace(super().scales(driven=driven), input_scale=share * self.input_scale)


class RidgeSums:
    """The sums of a ridge regression with a constant over states (T, N) and targets (T, C) that come in parts."""

    def __init__(self, neurons: int, channels: int) -> None:
        self.squares = np.zeros((neurons + 1, neurons + 1))  # of states with a 1 behind them
        self.products = np.zeros((neurons + 1, channels))  # with the targets

    def add(self, states: Array, targets: Array) -> None:
        known = np.column_stack([states, np.ones(len(states))])
        self.squares += known.T @ known
        self.products += known.T @ targets

    def solve(self, regulariser: float) -> Float32:
        """(W, w) with targets ~ W states + w, w not regularised, shape (C, N + 1)."""
        from scipy.linalg import solve  # what plays needs none of it

        penalty = np.full(len(self.squares), regulariser)
        penalty[-1] = 0.0
        weights = solve(self.squares + np.diag(penalty), self.products, assume_a="pos")
        return np.ascontiguousarray(weights.T, dtype=np.float32)


@dataclass(frozen=True)
class PieceLesson:
    """What one piece of a motion is learned from, T frames with its overlap."""

    before: Array  # states of the driven reservoir before each frame, shape (T, N)
    states: Array  # and after it
    inputs: Array  # the frames, normalised, shape (T, C)


def piece_lessons(
    motion: TrainingMotion, course: PhaseCourse, reservoir: PhaseReservoir, rate: float
) -> Iterator[PieceLesson]:
    """The lessons of the pieces of a motion; a loop with an input has one piece, of all recorded values together."""
    washout, overlap = round(WASHOUT_SECONDS * rate), round(OVERLAP_SECONDS * rate)
    if motion.driving is not None:
        before, after = [], []
        for variant in motion.variants:
            one = TrainingMotion(motion.name, variant.frames, loop=True)
            states, first = _driven_states(one, course, reservoir, washout, 0, motion.driving.level(variant.value))
            before.append(states[first - 1 : -1])
            after.append(states[first:])
        frames = np.concatenate([variant.frames for variant in motion.variants])
        yield PieceLesson(np.concatenate(before), np.concatenate(after), frames)
        return
    many = int(course.piece[-1]) + 1
    overlap = 0 if motion.loop and many == 1 else overlap
    states, first = _driven_states(motion, course, reservoir, washout, overlap)
    for piece in range(many):
        at = _window(course, piece, overlap)
        inputs = motion.frames[at % len(course.phase) if motion.loop else np.maximum(at, 0)]
        yield PieceLesson(states[first + at - 1], states[first + at], inputs)


def _driven_states(
    one: TrainingMotion, course: PhaseCourse, reservoir: PhaseReservoir, washout: int, overlap: int, level: float = 0.0
) -> tuple[Array, int]:
    """The states of the driven reservoir, and the index of the motion's first frame."""
    channels, phase = [one.lead_in(washout), one.frames], [course.before(washout), course.phase]
    if one.loop:
        channels.append(one.frames[:overlap])
        phase.append(course.phase[:overlap])
    inputs = np.hstack([reservoir.input_weights, reservoir.phase_weights])
    bias = reservoir.bias + level * reservoir.drive_weights.sum(1)
    signal = np.hstack([np.concatenate(channels), reservoir.harmonics_of(np.concatenate(phase) + course.turn)])
    (states,) = drive(Reservoir(reservoir.weights, inputs, bias), [signal.astype(np.float64)])
    return states.astype(np.float64), len(channels[0])


def _window(course: PhaseCourse, piece: int, overlap: int) -> Indices:
    """The frames of a piece and its overlap; negative ones lie before the motion."""
    own = np.flatnonzero(course.piece == piece)
    last = own[-1] + overlap
    return np.arange(own[0] - overlap, 1 + (last if course.loop else min(last, len(course.phase) - 1)))


def _learn_piece(lesson: PieceLesson, recipe: PhaseRecipe, sums: RidgeSums | None) -> StoredPieces:
    """A piece, without its readout; the regressions use mean and directions as they are stored."""
    mean = lesson.states.mean(0).astype(np.float16)
    values, directions = principal_directions(lesson.states - mean, recipe.rank)
    strength = values / (values + recipe.aperture**-2)
    piece = StoredPieces.unread(directions, strength, mean, (lesson.inputs.shape[1], recipe.rank))
    if sums is not None:
        sums.add(lesson.before, lesson.inputs)
        return piece
    estimate = affine_ridge((lesson.before - mean) @ piece.basis[0].astype(np.float64), lesson.inputs, recipe.ridge)
    return replace(piece, estimate=estimate.astype(np.float32).astype(np.float16)[None])


# Neurons and ranks.
_SIZES = (80, 20), (110, 25), (150, 28), (200, 32), (250, 36), (300, 40), (360, 46), (440, 54), (540, 62), (660, 72)


class PhaseConceptorTrainer(PhaseDrivenTrainer[PhaseRecipe]):
    """Trains phase-driven conceptors."""

    recipe = PhaseRecipe
    plays = PhaseConceptorNetwork
    sizes = tuple({"neurons": neurons, "rank": rank} for neurons, rank in _SIZES)

    def unread(
        self,
        recipe: PhaseRecipe,
        motion: TrainingMotion,
        reservoir: PhaseReservoir,
        rate: float,
        sums: RidgeSums | None = None,
    ) -> PhaseConceptorMotion:
        """As the base; with sums the motion has no V, and what V is to be learned from goes into them."""
        course = course_of(motion, recipe.piece_seconds * rate)
        pieces = [_learn_piece(lesson, recipe, sums) for lesson in piece_lessons(motion, course, reservoir, rate)]
        stored = StoredPieces(
            *(on_disk(np.concatenate([getattr(one, field.name) for one in pieces])) for field in fields(StoredPieces))
        )
        return PhaseConceptorMotion(stored, course, reservoir, motion.driving)


TRAINER = PhaseConceptorTrainer()
