"""Trains phase-driven networks: each motion for itself in a reservoir that a phase drives."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from controller.learning.measures.accuracy import mabs
from controller.learning.measures.self_test import Judge
from controller.learning.reservoirs.phase_training import PhaseDrivenRecipe, train_phase_driven
from controller.learning.reservoirs.size_choice import smallest_within
from controller.learning.trainers.trainer import Lessons, NewMotion, Trainer
from controller.motion.rotations import Array
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork

Recipe = TypeVar("Recipe", bound=PhaseDrivenRecipe)


class PhaseDrivenTrainer(Trainer[Recipe]):
    """Learns the readouts of each motion from the settled states of the network."""

    center_driven = takes_inputs = True
    least_range = 1.0

    def sized(
        self, recipe: Recipe, lessons: Lessons, seed: int, judge: Judge, progress: Callable[[str], None]
    ) -> Recipe:
        """The recipe with the smallest size that keeps to its tolerance, if it has one."""
        if recipe.tolerance_mm is None:
            return recipe
        learned = lessons.motions, lessons.normalisation
        return smallest_within(recipe.tolerance_mm, *learned, recipe, lessons.rate, seed, judge, progress)

    def train(self, recipe: Recipe, lessons: Lessons, seed: int) -> PhaseDrivenNetwork[Any]:
        """One network that holds all motions, untested."""
        return train_phase_driven(lessons.motions, lessons.normalisation, recipe, lessons.rate, seed)

    def add(
        self, recipe: Recipe, network: PhaseDrivenNetwork[Any], motion: NewMotion
    ) -> tuple[PhaseDrivenNetwork[Any], tuple[None, None]]:
        """The network with one more motion."""
        one = motion.scaled(network.normalisation)
        part = recipe.learn(one, network.reservoir, network.normalisation, motion.rate)
        return network.with_motions({motion.name: part}), (None, None)

    def readout_size(self, network: PhaseDrivenNetwork[Any], scaling: Array) -> float:
        """The mean absolute readout, of channels scaled to [-1, 1]."""
        parts = [network[name].readout[:, :, :-1] for name in network.motions]
        return float(np.mean([mabs(readout * scaling[:, None]) for readout in parts]))
