"""Trains conceptor networks whose motions share all weights: only the conceptors are a motion's own.

The reservoir is driven with the channels and the phase of each motion in turn. From all of its states together one
V is learned, which predicts a frame from the state before it (the effect of eq. 3.11 of Deliallisi 2017), and from the
states of the network when it plays by itself one R (eq. 3.13), both by ridge regression. The sums of either grow
with the neurons and not with the motions.

With one R for all, loops are rolled into step before, so that what is computed from their conceptors moves
(`motion_algebra`).
"""

from dataclasses import replace
from typing import Any, Literal

import msgspec
import numpy as np

from controller.learning.preparation.cycles import in_step
from controller.learning.preparation.training_motion import Lessons, TrainingMotion
from controller.learning.trainers.phase_conceptor import PhaseConceptorTrainer, PhaseRecipe, RidgeSums
from controller.learning.trainers.phase_driven import settled_lesson
from controller.learning.trainers.trainer import NewMotion
from controller.networks.reservoirs.phase_reservoir import PhaseReservoir
from controller.networks.shared_conceptor.network import SharedConceptorNetwork


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


class SharedConceptorTrainer(PhaseConceptorTrainer):
    """Trains conceptors that share their weights."""

    recipe = SharedConceptorRecipe
    plays = SharedConceptorNetwork
    _sizes = (300, 40), (400, 48), (550, 56), (750, 65), (1000, 75), (1400, 90)
    sizes = tuple({"neurons": neurons, "rank": rank} for neurons, rank in _sizes)

    def learn_all(self, recipe: Any, lessons: Lessons, reservoir: PhaseReservoir) -> dict[str, Any]:
        channels = lessons.motions[0].frames.shape[1]
        sums = RidgeSums(recipe.neurons, channels)
        motions = lessons.motions if recipe.readout == "own" else _in_step(lessons)
        unread = [self.unread(recipe, motion, reservoir, lessons.rate, sums) for motion in motions]
        estimate = sums.solve(recipe.ridge).astype(np.float16)
        parts = [one.sharing("estimate", estimate) for one in unread]
        learned = list(zip(parts, motions, strict=True))
        if recipe.readout == "own":
            parts = [self.read(recipe, part, motion, lessons.normalisation) for part, motion in learned]
        else:
            sums = RidgeSums(recipe.neurons, channels)
            for part, motion in learned:
                states, frames, piece = settled_lesson(part, motion)
                frames = lessons.normalisation.invert(frames)
                for one, (mean, basis) in enumerate(zip(part.stored.mean, part.stored.basis, strict=True)):
                    sums.add(mean + states[piece == one] @ basis.T.astype(np.float64), frames[piece == one])
            readout = sums.solve(recipe.ridge)
            parts = [part.sharing("readout", readout) for part in parts]
        return {motion.name: part for part, (_, motion) in zip(parts, learned, strict=True)}

    def add(self, recipe: Any, network: Any, motion: NewMotion) -> SharedConceptorNetwork:
        """One conceptor more with the V of all; it is read in its own directions, and in pieces as others are then."""
        one = motion.scaled(network.normalisation)
        own = msgspec.structs.replace(recipe, piece_seconds=min(recipe.piece_seconds, PhaseRecipe().piece_seconds))
        sums = RidgeSums(network.neurons, network.channels)  # of which no V is learned: it is there
        unread = self.unread(own, one, network.reservoir, motion.rate, sums)
        estimate = network[network.motions[0]].shared["estimate"]
        part = self.read(own, unread.sharing("estimate", estimate), one, network.normalisation)
        return network.with_motions({motion.name: part})


def _in_step(lessons: Lessons) -> list[TrainingMotion]:
    """The motions, loops turned so that one phase is the same part of each, as a mixture of conceptors wants it."""
    loops = {one.name: one.frames for one in lessons.motions if one.loop and one.driving is None}
    units = lessons.normalisation.invert
    turns = in_step({name: lessons.features(units(frames)) for name, frames in loops.items()})
    return [replace(one, turn=turns.get(one.name, 0.0)) for one in lessons.motions]


TRAINER = SharedConceptorTrainer()
