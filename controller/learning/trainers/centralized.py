"""Trains centralized networks."""

from __future__ import annotations

import numpy as np

from controller.learning.centralized.centralized_training import CentralizedRecipe, train_centralized_network
from controller.learning.measures.accuracy import mabs, nrmse
from controller.learning.preparation.training_motion import TrainingMotion
from controller.learning.trainers.trainer import Lessons, NewMotion, Trainer
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array
from controller.networks.centralized.network import CentralizedNetwork


class CentralizedTrainer(Trainer[CentralizedRecipe]):
    """Learns the centers and satellites of each motion for itself."""

    recipe = CentralizedRecipe
    center_driven = True
    # The state is a place on a closed curve; the centers return there by themselves.
    stress_tested = False
    noise_note = "Both coordinates of every center are disturbed; the satellites follow from them."
    stored_noise_note = noise_note

    def train(self, recipe: CentralizedRecipe, lessons: Lessons, seed: int) -> CentralizedNetwork:
        """One network that holds all motions, untested."""
        return train_centralized_network(lessons.motions, lessons.normalisation, recipe, lessons.rate, seed)

    def add(
        self, recipe: CentralizedRecipe, network: CentralizedNetwork, motion: NewMotion
    ) -> tuple[CentralizedNetwork, tuple[None, None]]:
        """The network with one more motion."""
        normalisation = Normalisation.fit([motion.frames])
        to_learn = TrainingMotion(motion.name, normalisation.apply(motion.frames), motion.loop)
        lessons = Lessons([to_learn], normalisation, motion.rate)
        return network.joined(self.train(recipe, lessons, motion.seed)), (None, None)

    def error_of(self, recipe: CentralizedRecipe, network: CentralizedNetwork, motion: str, frames: Array) -> float:
        """The NRMSE of a motion beside the frames (T, C) that it learned."""
        return nrmse(network[motion].at(np.arange(len(frames)) / network.rate), frames)

    def readout_size(self, network: CentralizedNetwork, scaling: Array) -> float:
        """The mean absolute W, of channels scaled to [-1, 1]."""
        return float(np.mean([mabs(network[name].matrix * scaling[:, None]) for name in network.motions]))


TRAINER = CentralizedTrainer()
