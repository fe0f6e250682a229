"""Trains centralized networks, with sizes of the recipe or those preferred by AICc."""

from typing import Literal

import msgspec
import numpy as np

from controller.learning.centralized.motion_training import CENTERS, SATELLITES, Rank, score_models, train_centralized
from controller.learning.preparation.training_motion import Lessons, TrainingMotion
from controller.learning.trainers.trainer import NewMotion, Trainer, mabs, nrmse
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array
from controller.networks.centralized.network import ANCHOR_EVERY, CentralizedNetwork
from controller.networks.centralized.switching_design import design_module


class CentralizedRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, tag="centralized"):
    """The parameters of a centralized network."""

    centers: int | Literal["auto"] = 2  # n of each motion, or "auto" for the choice of Akaike's criterion
    satellites: int | Literal["auto"] = 60  # m of each motion, at most a third of its frames; or "auto" likewise
    # Of W: "full", or "auto" for the low rank preferred by Akaike's criterion, with at most `satellites`.
    rank: Rank = "full"
    iterations: int = 150  # of the joint refinement of all satellites
    anchor_every = ANCHOR_EVERY


def _sizes(recipe: CentralizedRecipe, channels: Array, rate: float, *, loop: bool, seed: int) -> tuple[int, int]:
    fits = max(1, len(channels) // 3)
    centers = CENTERS if recipe.centers == "auto" else (recipe.centers,)
    satellites = SATELLITES if recipe.satellites == "auto" else (max(1, min(recipe.satellites, fits)),)
    if len(centers) == len(satellites) == 1:
        return centers[0], satellites[0]
    best = score_models(channels, rate, loop=loop, centers=centers, satellites=satellites, seed=seed)[0]
    return best.centers, best.satellites


class CentralizedTrainer(Trainer[CentralizedRecipe]):
    """Learns the centers and satellites of each motion for itself."""

    recipe = CentralizedRecipe
    center_driven = True
    # The state is a place on a closed curve; the centers return there by themselves.
    stress_tested = False
    noise_note = "Both coordinates of every center are disturbed; the satellites follow from them."
    stored_noise_note = noise_note

    def train(self, recipe: CentralizedRecipe, lessons: Lessons, seed: int) -> CentralizedNetwork:
        """One network of motions trained independently; SwitchingModuleError, at once, if they are too many."""
        normalisation, rate = lessons.normalisation, lessons.rate
        design_module(len(lessons.motions))
        motions = {}
        for motion in lessons.motions:
            channels = normalisation.invert(motion.frames)
            sizes = _sizes(recipe, channels, rate, loop=motion.loop, seed=seed)
            motions[motion.name] = train_centralized(
                channels, rate, *sizes, loop=motion.loop, rank=recipe.rank, iterations=recipe.iterations, seed=seed
            )
        return CentralizedNetwork(motions, rate)

    def add(self, recipe: CentralizedRecipe, network: CentralizedNetwork, motion: NewMotion) -> CentralizedNetwork:
        normalisation = Normalisation.fit([motion.frames])
        to_learn = TrainingMotion(motion.name, normalisation.apply(motion.frames), motion.loop)
        lessons = Lessons([to_learn], normalisation, motion.rate)
        return network.joined(self.train(recipe, lessons, motion.seed))

    def error_of(self, recipe: CentralizedRecipe, network: CentralizedNetwork, motion: str, frames: Array) -> float:
        """The NRMSE of a motion beside the frames (T, C) that it learned."""
        return nrmse(network[motion].at(np.arange(len(frames)) / network.rate), frames)

    def readout_size(self, network: CentralizedNetwork, scaling: Array) -> float:
        return float(np.mean([mabs(network[name].matrix * scaling[:, None]) for name in network.motions]))


TRAINER = CentralizedTrainer()
