"""Trains random feature conceptors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from controller.learning.measures.accuracy import mabs
from controller.learning.reservoirs.random_feature_training import RandomFeatureRecipe, train_random_features
from controller.learning.trainers.trainer import Lessons, Trainer
from controller.motion.rotations import Array
from controller.networks.random_feature.network import RandomFeatureNetwork


class RandomFeatureTrainer(Trainer[RandomFeatureRecipe]):
    """Learns conception weights and two regressions for all motions at once."""

    recipe = RandomFeatureRecipe

    def problems(self, recipe: RandomFeatureRecipe, motions: Sequence[str]) -> Iterator[str]:
        """Numbers with which the weights cannot be learned."""
        if recipe.features_each > recipe.features:
            yield f"network.features_each is {recipe.features_each}, but network.features is {recipe.features}"
        # A feature's energy is hardly ever above 1, so a step of the rule in `conceive` shrinks what c is off by.
        if recipe.aperture > 0.0 and recipe.learning_rate * (1.0 + recipe.aperture**-2) >= 1.0:
            yield (
                f"network.learning_rate = {recipe.learning_rate} is too large for network.aperture = "
                f"{recipe.aperture}: learning_rate * (1 + aperture^-2) has to stay below 1; learn slower or open wider"
            )

    def train(self, recipe: RandomFeatureRecipe, lessons: Lessons, seed: int) -> RandomFeatureNetwork:
        """One network that holds all motions, untested."""
        return train_random_features(lessons.motions, lessons.normalisation, recipe, seed)

    def readout_size(self, network: RandomFeatureNetwork, scaling: Array) -> float:
        """The mean absolute readout, of channels scaled to [-1, 1]."""
        return mabs(network.reservoir.readout * scaling)


TRAINER = RandomFeatureTrainer()
