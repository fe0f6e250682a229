"""Trains conceptor networks."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from controller.learning.measures.self_test import Judge
from controller.learning.preparation.training_motion import Lessons
from controller.learning.reservoirs import conceptor_training
from controller.learning.reservoirs.aperture_choice import settled_network
from controller.learning.reservoirs.conceptor_training import ConceptorRecipe, input_targets, load_reservoir
from controller.learning.trainers.trainer import SettledNetwork, Trainer, TrainingError, mabs, nrmse
from controller.motion.rotations import Array
from controller.networks.conceptor.network import ConceptorNetwork


class ConceptorTrainer(Trainer[ConceptorRecipe]):
    """Loads motions into a reservoir and computes their conceptors."""

    recipe = ConceptorRecipe
    stored_noise_note = "A library keeps only the directions of its conceptors; only noise along them has an effect."

    def problems(self, recipe: ConceptorRecipe, motions: Sequence[str]) -> Iterator[str]:
        for name, aperture in recipe.apertures.items():
            if name not in motions:
                yield f"network.apertures names '{name}', which is not one of its motions"
            if not 0.0 < aperture <= 1e6:
                yield f"the aperture of '{name}' is {aperture}; it lies between 0 and 1e6"

    def train(self, recipe: ConceptorRecipe, lessons: Lessons, seed: int) -> ConceptorNetwork:
        return conceptor_training.conceptor_network(load_reservoir(lessons.motions, recipe, seed), lessons, recipe)

    def settle(self, recipe: ConceptorRecipe, lessons: Lessons, seed: int, judge: Judge) -> SettledNetwork:
        loaded = load_reservoir(lessons.motions, recipe, seed)
        chosen = settled_network(loaded, lessons, recipe, judge, seed)
        return SettledNetwork(*chosen, loaded.weights.astype(np.float32))

    def training_error(
        self, recipe: ConceptorRecipe, lessons: Lessons, frames: Mapping[str, Array], seed: int, judge: Judge
    ) -> TrainingError:
        """Trains and measures the one readout of all motions, and W where it was learned in full."""
        loaded = load_reservoir(lessons.motions, recipe, seed)
        network, _ = settled_network(loaded, lessons, recipe, judge, seed)
        states = np.concatenate(loaded.states)
        inputs = np.concatenate([lesson.frames for lesson in lessons.motions])
        sized = error = None
        if recipe.learns == "weights":
            before = np.concatenate(loaded.before)
            sized = mabs(loaded.weights)
            error = nrmse(before @ loaded.weights.T, input_targets(loaded.reservoir, before, inputs))
        off = nrmse(states @ loaded.readout.T, inputs)
        return TrainingError(seed, mabs(loaded.readout), off, sized, error, network)


TRAINER = ConceptorTrainer()
