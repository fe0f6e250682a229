"""Chooses the aperture of each motion by trials, in the order of Jaeger's attenuation criterion.

A conceptor with too small an aperture removes parts of the motion, one with too large an aperture passes other signals;
either way the result of a step, h = tanh(W x + b), differs from its projection x = m + C (h - m). The attenuation

    E|h - x|^2 / E|h - m|^2

of the free-running network is least in between (Jaeger 2014, section 3.8.5). It does not show whether a motion survives
a disturbance, so every choice is tested: run free, started from noise, and disturbed.
"""

import numpy as np

from controller.learning.measures.disturbance import Kind, failures
from controller.learning.measures.self_test import Judge
from controller.learning.preparation.training_motion import Lessons, TrainingMotion
from controller.learning.reservoirs import conceptor_training
from controller.learning.reservoirs.conceptor_training import ConceptorRecipe, LoadedReservoir
from controller.motion.rotations import Array
from controller.networks.conceptor.network import ConceptorNetwork

APERTURES = (5.0, 7.0, 10.0, 14.0, 20.0, 30.0, 50.0, 80.0)

# Steps of each run for its attenuation, and the first step that counts.
STEPS, SETTLED = 400, 60

# Trials of a loop. A one-shot may be at any phase after a disturbance.
LOOP: tuple[Kind, ...] = ("robustness", "stability")


def settled_network(
    loaded: LoadedReservoir, lessons: Lessons, recipe: ConceptorRecipe, judge: Judge, seed: int
) -> tuple[ConceptorNetwork, dict[str, int]]:
    """The network of a loaded reservoir, and the failed trials of each motion if the recipe chooses apertures."""
    # A motion that fails a trial gets the first aperture with which it passes all, else that with the fewest failures.
    # Then all are cut to the rank that the recipe's tolerance allows, if it has one, and tested again.
    network = conceptor_training.conceptor_network(loaded, lessons, recipe)
    failed: dict[str, int] = {}
    weights = loaded.weights.astype(np.float32)

    def failures_of(network: ConceptorNetwork, motion: TrainingMotion) -> int:
        return failures(network, motion.name, LOOP if motion.loop else (), judge, seed, weights)

    for motion, states in zip(lessons.motions, loaded.states, strict=True) if recipe.choose_apertures else ():
        name, fewest = motion.name, failures_of(network, motion)
        fixed = name in recipe.apertures or fewest == 0
        for index in [] if fixed else np.argsort(attenuations(states, loaded, recipe)):
            aperture = APERTURES[index]
            part = conceptor_training.conceptor_motion(states, loaded, lessons.normalisation, recipe, aperture)
            tried = network.with_motions({name: part})
            if (failing := failures_of(tried, motion)) < fewest:
                fewest, network = failing, tried
            if fewest == 0:
                break
        failed[name] = fewest
    if recipe.rank_tolerance_mm is not None:
        network = conceptor_training.cut_to_tolerance(network, judge.encoding, recipe.rank_tolerance_mm)
        if failed:
            # The trials were those of the uncut conceptors.
            failed = {motion.name: failures_of(network, motion) for motion in lessons.motions}
    return network, failed


def attenuations(states: Array, loaded: LoadedReservoir, recipe: ConceptorRecipe) -> Array:
    """The attenuation of a motion with states (T, N) at each of APERTURES, all running side by side."""
    mean = conceptor_training.mean_state(states, recipe)
    values, directions = conceptor_training.principal_directions(states - mean, recipe.rank)
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
