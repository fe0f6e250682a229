"""Trains echo-state networks."""

from __future__ import annotations

import numpy as np

from controller.learning.measures.self_test import Judge
from controller.learning.reservoirs.echo_state_training import EchoStateRecipe, learn_readouts, train_echo_state
from controller.learning.reservoirs.noise_choice import settled_echo_state
from controller.learning.trainers.trainer import Lessons, NewMotion, SettledNetwork, Trainer
from controller.networks.echo_state.network import EchoStateNetwork
from controller.networks.reservoirs.reservoir import Reservoir


class EchoStateTrainer(Trainer[EchoStateRecipe]):
    """Learns a readout for each motion by teacher forcing."""

    recipe = EchoStateRecipe

    def train(self, recipe: EchoStateRecipe, lessons: Lessons, seed: int) -> EchoStateNetwork:
        """One network that holds all motions, untested."""
        return train_echo_state(lessons.motions, lessons.normalisation, recipe, seed)

    def settle(self, recipe: EchoStateRecipe, lessons: Lessons, seed: int, judge: Judge) -> SettledNetwork:
        """The network with the noise that holds in trials, where the recipe chooses it."""
        if not recipe.choose_noise:
            return super().settle(recipe, lessons, seed, judge)
        return SettledNetwork(*settled_echo_state(lessons.motions, lessons.normalisation, recipe, judge, seed))

    def add(
        self, recipe: EchoStateRecipe, network: EchoStateNetwork, motion: NewMotion
    ) -> tuple[EchoStateNetwork, tuple[None, None]]:
        """The network with one more readout."""
        reservoir = Reservoir(network.weights, network.feedback, network.bias, network.leak)
        # The noise is the same whenever this motion is added in this place.
        rng = np.random.default_rng([motion.seed, len(motion.lengths)])
        part = learn_readouts(reservoir, [motion.scaled(network.normalisation)], recipe, rng)
        return network.with_motions(part), (None, None)


TRAINER = EchoStateTrainer()
