"""Which aperture for which motion? One that holds in trials; they go in the order of Jaeger's attenuation criterion.

With too small an aperture a conceptor takes parts of the motion away, with too large a one it lets through what does
not belong to it; either way what comes out of a step, h = tanh(W x + b), is not what is let through,
x = m + C (h - m). The attenuation

    E|h - x|^2 / E|h - m|^2

of the network running by itself is least in between (Jaeger 2014, section 3.8.5). It says where a motion loses little,
not whether it survives a disturbance, so every choice is tried: run free, started from noise, and disturbed.
"""

from __future__ import annotations

import numpy as np

from controller.evaluation.batch import ConceptorBatch
from controller.evaluation.disturbance import Kind, disturbed
from controller.generators.conceptor import ConceptorNetwork
from controller.mocap.normalisation import Normalisation
from controller.rotations import Array
from controller.training.conceptor_training import (
    ConceptorRecipe,
    LoadedReservoir,
    conceptor_motion,
    conceptor_network,
    mean_state,
    principal_directions,
)
from controller.training.lesson import Lesson
from controller.training.rank_choice import cut_to_tolerance
from controller.training.self_test import Judge, self_test

APERTURES = (5.0, 7.0, 10.0, 14.0, 20.0, 30.0, 50.0)

# How long each is run for its attenuation, and from when on it counts.
STEPS, SETTLED = 400, 60

# Disturbed runs of each kind in a trial, and what a failure of the free run counts.
RUNS = 8
FREE_RUN = 2 * RUNS


def settled_network(
    loaded: LoadedReservoir,
    lessons: list[Lesson],
    normalisation: Normalisation,
    recipe: ConceptorRecipe,
    judge: Judge,
    seed: int,
) -> ConceptorNetwork:
    """The network of a loaded reservoir; a motion that fails a trial gets the first aperture at which it does not.

    Where there is none it gets the one with the fewest failures; a recipe that does not choose gets its own.
    Then all are cut to the rank that the recipe's tolerance allows, if it has one.

    Args:
        loaded, lessons, normalisation, recipe: as for `conceptor_network`.
        judge: of the motions.
        seed: of the noise in the trials.
    """
    network = conceptor_network(loaded, lessons, normalisation, recipe)
    if recipe.choose_apertures:
        network = _tried(network, loaded, lessons, normalisation, recipe, judge, seed)
    if recipe.rank_tolerance_mm is not None:
        network = cut_to_tolerance(network, judge.encoding, recipe.rank_tolerance_mm)
    return network


def _tried(
    network: ConceptorNetwork,
    loaded: LoadedReservoir,
    lessons: list[Lesson],
    normalisation: Normalisation,
    recipe: ConceptorRecipe,
    judge: Judge,
    seed: int,
) -> ConceptorNetwork:
    """The network with other apertures where its own do not hold."""
    weights = loaded.weights.astype(np.float32)
    motions = {name: network[name] for name in network.motions}
    for lesson, states in zip(lessons, loaded.states, strict=True):
        if lesson.name in recipe.apertures:
            continue
        fewest = _failures(network, lesson.name, weights, judge, seed)
        if fewest == 0:
            continue
        for aperture in by_attenuation(states, loaded, recipe):
            part = conceptor_motion(states, loaded, normalisation, recipe, aperture)
            failures = _failures(ConceptorNetwork({lesson.name: part}), lesson.name, weights, judge, seed)
            if failures < fewest:
                fewest, motions[lesson.name] = failures, part
            if fewest == 0:
                break
    return ConceptorNetwork(motions, network.memory)


def by_attenuation(states: Array, loaded: LoadedReservoir, recipe: ConceptorRecipe) -> list[float]:
    """APERTURES for a motion with states (T, N), the one with the least attenuation first."""
    lost = attenuations(states, loaded, recipe)
    return [APERTURES[i] for i in np.argsort(lost)]


def attenuations(states: Array, loaded: LoadedReservoir, recipe: ConceptorRecipe) -> Array:
    """The attenuation of a motion with states (T, N) at each of APERTURES, all running side by side."""
    mean = mean_state(states, recipe)
    values, directions = principal_directions(states - mean, recipe.rank)
    singular = (values / (values + np.array(APERTURES)[:, None] ** -2)).astype(np.float32)
    ahead, back = (loaded.weights @ directions).T.astype(np.float32), directions.astype(np.float32)
    bias, centre = (loaded.weights @ mean + loaded.reservoir.bias).astype(np.float32), mean.astype(np.float32)
    z = np.repeat(((states[0] - mean) @ directions)[None].astype(np.float32), len(APERTURES), axis=0)
    lost, all_of_it = np.zeros(len(z)), np.zeros(len(z))
    for step in range(STEPS):
        apart = np.tanh(z @ ahead + bias) - centre
        along = apart @ back
        z = singular * along
        if step >= SETTLED:
            energy = np.square(apart).sum(1)
            all_of_it += energy
            # |h - x|^2, for U has orthonormal columns.
            lost += energy - ((2.0 - singular) * singular * np.square(along)).sum(1)
    return np.maximum(lost, 0.0) / np.maximum(all_of_it, 1e-12)


def _failures(network: ConceptorNetwork, motion: str, weights: np.ndarray, judge: Judge, seed: int) -> int:
    """How many runs fail: the free one, and of loops those started from noise or disturbed."""
    failed = 0 if self_test(network, judge, (motion,))[motion].passed else FREE_RUN
    if failed or not judge.loops[motion]:
        return failed
    kinds: tuple[Kind, ...] = ("robustness", "stability")
    for kind in kinds:
        rng = np.random.default_rng([seed, *motion.encode(), kind == "stability"])
        runs = disturbed(kind, ConceptorBatch(network, motion, RUNS, weights), RUNS, rng)
        failed += sum(not judge(motion, run.astype(np.float64)).passed for run in runs)
    return failed
