"""Trains conceptor networks whose motions share all weights: only the conceptors are a motion's own.

The reservoir is driven with the channels and the phase of each motion in turn. From all of its states together one
V is learned, which predicts a frame from the state before it (the effect of eq. 3.11 of Deliallisi 2017), and from the
states of the network when it plays by itself one W_out (eq. 3.13), both by ridge regression. The sums of either grow
with the neurons and not with the motions.
"""

from collections.abc import Iterator, Sequence
from typing import Any, Literal

import numpy as np

from controller.learning.preparation.training_motion import Lessons, TrainingMotion
from controller.learning.trainers.phase_conceptor import PhaseRecipe, conceptor_of, piece_lessons
from controller.learning.trainers.phase_driven import PhaseDrivenTrainer, course_of, settled_lesson
from controller.learning.trainers.trainer import NewMotion
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array
from controller.networks.base import AnyNetwork
from controller.networks.phase_conceptor.network import Float16, PhaseConceptorMotion
from controller.networks.reservoirs.phase_reservoir import Float32, PhaseCourse, PhaseReservoir
from controller.networks.reservoirs.readout_learning import learn_readouts
from controller.networks.shared_conceptor.network import Selection, SharedConceptorMotion, SharedConceptorNetwork


class SharedConceptorRecipe(PhaseRecipe, frozen=True, kw_only=True, tag="shared-conceptor"):
    """The parameters of conceptors that share their weights."""

    neurons: int = 1000
    spectral_radius: float = 1.2
    input_scale: float = 0.8  # of W_in
    bias_scale: float = 0.5  # of b
    aperture: float = 40.0  # alpha
    rank: int = 75  # k, number of directions kept of a conceptor
    piece_seconds: float = 3.0  # approximate duration of the pieces of a motion, s
    ridge: float = 1e-4  # gamma of both regressions
    # One W_out for all motions, or one for each in its own directions, for more motions than the neurons have room for.
    readout: Literal["shared", "own"] = "own"


class RidgeSums:
    """The sums of a ridge regression with a constant over states (T, N) and targets (T, C) that come in parts."""

    def __init__(self, neurons: int, channels: int) -> None:
        self.squares = np.zeros((neurons + 1, neurons + 1))  # of states with a 1 behind them
        self.products = np.zeros((neurons + 1, channels))  # with the targets

    def add(self, states: Array, targets: Array) -> None:
        """Counts further states and their targets."""
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


class SharedConceptorTrainer(PhaseDrivenTrainer[SharedConceptorRecipe]):
    """Trains conceptors that share their weights."""

    recipe = SharedConceptorRecipe
    plays = SharedConceptorNetwork
    sizes = tuple(
        {"neurons": neurons, "rank": rank}
        for neurons, rank in ((300, 40), (400, 48), (550, 56), (750, 65), (1000, 75), (1400, 90))
    )

    def train(self, recipe: SharedConceptorRecipe, lessons: Lessons, seed: int) -> SharedConceptorNetwork:
        channels = lessons.motions[0].frames.shape[1]
        scales = recipe.scales(driven=any(one.driving is not None for one in lessons.motions))
        reservoir = PhaseReservoir.draw(scales, channels, seed)
        sums = RidgeSums(recipe.neurons, channels)
        selected = [_selected(motion, reservoir, recipe, lessons.rate, sums) for motion in lessons.motions]
        estimate = sums.solve(recipe.ridge)
        unread = [
            SharedConceptorMotion(selection, estimate, np.zeros_like(estimate), course, reservoir, motion.driving)
            for motion, (selection, course) in zip(lessons.motions, selected, strict=True)
        ]
        motions = dict(_read(unread, lessons.motions, recipe, lessons.normalisation))
        return SharedConceptorNetwork(scales, seed, lessons.normalisation, motions)

    def add(self, recipe: SharedConceptorRecipe, network: SharedConceptorNetwork, motion: NewMotion) -> AnyNetwork:
        """One conceptor more, with a readout in its own directions; what the motions share stays as it is."""
        if recipe.readout == "shared":
            return super().add(recipe, network, motion)
        known: Any = network[network.motions[0]]
        one, reservoir = motion.scaled(network.normalisation), network.reservoir
        selection, course = _selected(one, reservoir, recipe, motion.rate)
        unread = SharedConceptorMotion(selection, known.estimate, np.zeros_like(known.estimate), course, reservoir)
        return network.with_motions(dict(_read([unread], [one], recipe, network.normalisation)))


def _selected(
    motion: TrainingMotion,
    reservoir: PhaseReservoir,
    recipe: SharedConceptorRecipe,
    rate: float,
    sums: RidgeSums | None = None,
) -> tuple[Selection, PhaseCourse]:
    """The conceptors of a motion and its course, at a rate in Hz; what V is learned from goes into the sums."""
    course = course_of(motion, recipe.piece_seconds * rate)
    conceptors: list[tuple[Float16, Float32, Float16]] = []
    for lesson in piece_lessons(motion, course, reservoir, rate):
        if sums is not None:
            sums.add(lesson.before, lesson.inputs)
        conceptors.append(conceptor_of(lesson.states, recipe.rank, recipe.aperture))
    return Selection(*(np.stack(part) for part in zip(*conceptors, strict=True))), course


def _read(
    unread: Sequence[SharedConceptorMotion],
    motions: Sequence[TrainingMotion],
    recipe: SharedConceptorRecipe,
    normalisation: Normalisation,
) -> Iterator[tuple[str, PhaseConceptorMotion]]:
    """The motions by name with what reads their settled states."""
    sums = RidgeSums(recipe.neurons, motions[0].frames.shape[1])
    own: list[Float32] = []
    for part, motion in zip(unread, motions, strict=True):
        states, frames, piece = settled_lesson(part, motion)
        frames = normalisation.invert(frames)
        if recipe.readout == "own":
            own.append(learn_readouts(states, piece, frames, recipe.ridge))
            continue
        for one, (mean, directions) in enumerate(zip(part.selection.mean, part.selection.directions, strict=True)):
            sums.add(mean + states[piece == one] @ directions.T.astype(np.float64), frames[piece == one])
    shared = None if own else sums.solve(recipe.ridge)
    for place, (part, motion) in enumerate(zip(unread, motions, strict=True)):
        weights = own[place] if shared is None else shared
        yield (
            motion.name,
            SharedConceptorMotion(part.selection, part.estimate, weights, part.course, part.reservoir, motion.driving),
        )


TRAINER = SharedConceptorTrainer()
