"""Teaches a motion to a centralized network: rest, centers, satellites and weights.

A loop gets a slow center that turns once in its period and fast ones that make whole numbers of turns, so that the
curve on their torus is closed and the motion can go on for ever. A motion that happens once gets a slow center that
starts with a quarter, 0.45 or one turn and is moved with everything else.
"""

from __future__ import annotations

from itertools import combinations
from typing import Literal

import msgspec
import numpy as np

from controller.errors import MotiondeckError
from controller.generators.centralized import CentralizedMotion
from controller.generators.centralized_network import ANCHOR_EVERY, CentralizedNetwork
from controller.generators.switching_module import design_module
from controller.mocap.normalisation import Normalisation
from controller.rotations import Array
from controller.training.lesson import Lesson
from controller.training.satellite_learning import learn, ridge_readout, slow_and_fast

# Weights of normalised channels beyond this stand for satellites that cancel each other.
LARGEST_WEIGHT = 1e3

MOST_TURNS = 8
FREQUENCY_TRIES = 30


class CentralizedRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, tag="centralized"):
    """The parameters of a centralized network.

    Attributes:
        centers: n of each motion, or "auto" for what Akaike's criterion prefers.
        satellites: m of each motion, or a third of its frames where those are few; or "auto" likewise.
        iterations: of the joint refinement of all satellites.
    """

    centers: int | Literal["auto"] = 2
    satellites: int | Literal["auto"] = 60
    iterations: int = 150

    @property
    def anchor_every(self) -> int:
        """Frames between the places where a motion may be entered."""
        return ANCHOR_EVERY


def train_centralized_network(
    lessons: list[Lesson], normalisation: Normalisation, recipe: CentralizedRecipe, rate: float, seed: int
) -> CentralizedNetwork:
    """The network of several motions, each learned for itself.

    Raises:
        SwitchingModuleError: before anything is trained, if there are more motions than can be switched between.
        MotiondeckError: see `train_centralized`.
    """
    design_module(len(lessons))
    motions = {}
    for lesson in lessons:
        channels = normalisation.invert(lesson.frames)
        centers, satellites = _sizes(recipe, channels, rate, loop=lesson.loop, seed=seed)
        motions[lesson.name] = train_centralized(
            channels,
            rate,
            loop=lesson.loop,
            centers=centers,
            satellites=satellites,
            iterations=recipe.iterations,
            seed=seed,
        )
    return CentralizedNetwork(motions, rate)


def _sizes(recipe: CentralizedRecipe, channels: Array, rate: float, *, loop: bool, seed: int) -> tuple[int, int]:
    """n and m for a motion, chosen where the recipe leaves it open."""
    # It trains networks to compare them, by the function below.
    from controller.training.model_search import CENTERS, SATELLITES, score_models

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


def train_centralized(
    channels: Array,
    rate: float,
    *,
    loop: bool,
    centers: int = 2,
    satellites: int = 49,
    iterations: int = 150,
    seed: int = 0,
) -> CentralizedMotion:
    """The network of one motion.

    Args:
        channels: the motion, shape (K, D); of a loop one period, whose first frame follows its last.
        rate: frames per second.
        loop: whether it goes on for ever.
        centers, satellites: n and m.
        iterations: of the joint refinement of all satellites.
        seed: of the frequencies that are tried.

    Raises:
        MotiondeckError: if there are fewer frames than satellites, or the weights grow beyond LARGEST_WEIGHT.
    """
    if centers < 1 or satellites < 1:
        raise MotiondeckError(f"a network of {centers} centers and {satellites} satellites; it needs at least one each")
    frames = len(channels)
    seconds = frames / rate if loop else max(1, frames - 1) / rate
    time = np.arange(frames) / rate
    rest = channels.mean(0)
    scale = channels.std(0)
    scale = np.maximum(scale, 1e-3 * max(1e-12, float(scale.max())))
    target = (channels - rest) / scale
    starts = _closed(seconds, centers, seed) if loop else slow_and_fast(seconds, centers, FREQUENCY_TRIES, seed)
    learned = learn(target, time, satellites, starts, iterations=iterations, move_frequencies=not loop)
    weights = ridge_readout(learned.respond(time), target)
    if np.abs(weights).max() > LARGEST_WEIGHT:
        raise MotiondeckError(
            f"the weights grow to {np.abs(weights).max():.0f}: {satellites} satellites are too many for {frames} frames"
        )
    return CentralizedMotion(
        learned.frequency, learned.phase, learned.satellites, weights * scale[:, None], rest, seconds, loop
    )


def _closed(seconds: float, centers: int, seed: int) -> list[Array]:
    """Frequencies that make whole turns in a period: one turn, and each choice of faster ones (at most a few dozen)."""
    base = 2.0 * np.pi / seconds
    choices = [np.array((1, *faster)) for faster in combinations(range(2, MOST_TURNS + centers), centers - 1)]
    if len(choices) > FREQUENCY_TRIES:
        drawn = np.random.default_rng(seed).choice(len(choices), FREQUENCY_TRIES, replace=False)
        choices = [choices[i] for i in sorted(drawn)]
    return [base * turns for turns in choices]
