"""Teaches motions to a centralized network, with the sizes that its recipe gives or that AICc prefers."""

from __future__ import annotations

from typing import Literal

import msgspec

from controller.learning.centralized.model_search import CENTERS, SATELLITES, score_models
from controller.learning.centralized.motion_training import Rank, train_centralized
from controller.learning.preparation.training_motion import TrainingMotion
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array
from controller.networks.centralized.network import ANCHOR_EVERY, CentralizedNetwork
from controller.networks.centralized.switching_design import design_module


class CentralizedRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, tag="centralized"):
    """The parameters of a centralized network.

    Attributes:
        centers: n of each motion, or "auto" for what Akaike's criterion prefers.
        satellites: m of each motion, or a third of its frames where those are few; or "auto" likewise.
        rank: of W: "full", or "auto" for few weights, those that Akaike's criterion prefers; `satellites` is then the
            largest m.
        iterations: of the joint refinement of all satellites.
    """

    centers: int | Literal["auto"] = 2
    satellites: int | Literal["auto"] = 60
    rank: Rank = "full"
    iterations: int = 150

    @property
    def anchor_every(self) -> int:
        """Frames between the places where a motion may be entered."""
        return ANCHOR_EVERY


def train_centralized_network(
    to_learn: list[TrainingMotion], normalisation: Normalisation, recipe: CentralizedRecipe, rate: float, seed: int
) -> CentralizedNetwork:
    """The network of several motions, each learned for itself.

    Raises:
        SwitchingModuleError: before anything is trained, if there are more motions than can be switched between.
        MotiondeckError: see `train_centralized`.
    """
    design_module(len(to_learn))
    motions = {}
    for motion in to_learn:
        channels = normalisation.invert(motion.frames)
        centers, satellites = _sizes(recipe, channels, rate, loop=motion.loop, seed=seed)
        motions[motion.name] = train_centralized(
            channels,
            rate,
            loop=motion.loop,
            centers=centers,
            satellites=satellites,
            rank=recipe.rank,
            iterations=recipe.iterations,
            seed=seed,
        )
    return CentralizedNetwork(motions, rate)


def _sizes(recipe: CentralizedRecipe, channels: Array, rate: float, *, loop: bool, seed: int) -> tuple[int, int]:
    """n and m for a motion, chosen where the recipe leaves it open."""
    fits = max(1, len(channels) // 3)
    if recipe.centers != "auto" and recipe.satellites != "auto":
        return recipe.centers, max(1, min(recipe.satellites, fits))
    best = score_models(
        channels,
        rate,
        loop=loop,
        centers=CENTERS if recipe.centers == "auto" else (recipe.centers,),
        satellites=SATELLITES if recipe.satellites == "auto" else (min(recipe.satellites, fits),),
        seed=seed,
    )[0]
    return best.centers, best.satellites
