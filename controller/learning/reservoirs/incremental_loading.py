"""Loads one more motion into a trained conceptor network, without the recordings of the others.

The stored parameters of motion j give its correlation  X_j' X_j = N U diag(l) U' + T m m'. From their sum G, the states
X and inputs P of the new motion update V as in joint training (recursive ridge regression, cf. Jaeger 2014, section
3.11):

    V' = V + E' X (G + X' X + gamma I)^-1,      E = P - X V'

and W_out likewise. In the space of the stored motions G is large and V hardly changes. Their own W U stays bit by bit.
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from controller.learning.preparation.training_motion import TrainingMotion
from controller.learning.reservoirs.aperture_choice import APERTURES
from controller.learning.reservoirs.conceptor_training import (
    ConceptorRecipe,
    LoadedReservoir,
    conceptor_motion,
    draw_reservoir,
    mean_state,
)
from controller.motion.rotations import Array
from controller.networks.conceptor.network import ConceptorMotion, ConceptorNetwork, Memory
from controller.networks.reservoirs.reservoir import Reservoir, drive
from motiondeck_base.errors import MotiondeckError

UNUSED = 1e-6  # a motion does not use directions with smaller singular values
REDRAWN = 1e-2  # largest relative difference between redrawn and stored weights, which have single precision


def load_one_more(
    network: ConceptorNetwork, lengths: dict[str, int], motion: TrainingMotion, recipe: ConceptorRecipe, seed: int
) -> ConceptorNetwork:
    """The network, trained with a recipe and seed, with one more motion, normalised by its memory.

    `lengths` are the frames of each stored motion. MotiondeckError if the network has no memory, all of W was learned,
    or its reservoir cannot be drawn again.
    """
    memory = memory_of(network)
    if recipe.learns != "input":
        raise MotiondeckError(
            'a network that learned all of W (learns = "weights") cannot be added to; train it with learns = "input"'
        )
    reservoir = draw_reservoir(recipe, network.channels, seed)
    estimate, readout = memory.estimate.astype(np.float64), memory.readout.astype(np.float64)
    _check_redrawn(network, reservoir, estimate)
    (states,) = drive(reservoir, [np.concatenate([motion.lead_in(recipe.washout), motion.frames])])
    before, states = states[-len(motion.frames) - 1 : -1], states[-len(motion.frames) :]
    known = used_directions(network, lengths, recipe)
    stored = len(reservoir) * (known @ known.T)
    stored[np.diag_indices(len(stored))] += recipe.ridge
    estimate = estimate + _correction(stored, before, motion.frames - before @ estimate.T)
    readout = readout + _correction(stored, states, motion.frames - states @ readout.T)
    weights = reservoir.weights + reservoir.input_weights @ estimate
    loaded = LoadedReservoir(reservoir, weights, readout, [before], [states])
    part = conceptor_motion(states, loaded, memory.normalisation, recipe, recipe.aperture)
    mean = mean_state(states, recipe)
    grown = replace(
        memory,
        estimate=estimate.astype(np.float32),
        readout=readout.astype(np.float32),
        means=np.vstack([memory.means, mean]).astype(np.float32),
    )
    return ConceptorNetwork({name: network[name] for name in network.motions} | {motion.name: part}, grown)


def quota(network: ConceptorNetwork, lengths: dict[str, int], recipe: ConceptorRecipe) -> float:
    """The share of the reservoir's space that the stored motions use, in [0, 1).

    The mean eigenvalue of the conceptor of everything stored (Jaeger 2014, section 3.11). MotiondeckError if the
    network has no memory.
    """
    known = used_directions(network, lengths, recipe)
    values = np.linalg.eigvalsh(known.T @ known)
    return float((values / (values + recipe.aperture**-2)).sum() / network.neurons)


def memory_of(network: ConceptorNetwork) -> Memory:
    """The memory of a network, for adding a motion; MotiondeckError if it was not stored."""
    if network.memory is None:
        raise MotiondeckError("this network was stored without what adding a motion needs; train it again with learn")
    return network.memory


def used_directions(network: ConceptorNetwork, lengths: dict[str, int], recipe: ConceptorRecipe) -> Array:
    """F with F F' = the sum of all motions' correlations (with the thesis's 1 / N), shape (N, directions)."""
    parts: list[Array] = []
    for name, mean in zip(network.motions, memory_of(network).means.astype(np.float64), strict=True):
        project = network[name].project.astype(np.float64)
        singular = np.linalg.norm(project, axis=1)
        used = singular > UNUSED
        singular = np.minimum(singular[used], 1.0 - UNUSED)
        directions = project[used].T / singular
        aperture = _aperture(
            network[name].states[:, used].astype(np.float64), singular, lengths[name], recipe, name, len(mean)
        )
        energy = singular / (1.0 - singular) * aperture**-2
        parts += [directions * np.sqrt(energy), mean[:, None] * np.sqrt(lengths[name] / len(mean))]
    return np.concatenate(parts, axis=1)


def _aperture(states: Array, singular: Array, frames: int, recipe: ConceptorRecipe, name: str, neurons: int) -> float:
    """The aperture of a stored motion; a chosen one follows from the stored states."""
    # With l their mean energy along a direction,  aperture^-2 = l (1 - s) / s.
    # A motion at rest uses no direction.
    if name in recipe.apertures or not recipe.choose_apertures or not len(singular):
        return recipe.apertures.get(name, recipe.aperture)
    energy = np.square(states).mean(0) * frames / neurons
    found = np.median(energy * (1.0 - singular) / singular) ** -0.5
    return min((recipe.aperture, *APERTURES), key=lambda tried: abs(np.log(tried / found)))


def _correction(stored: Array, states: Array, error: Array) -> Array:
    return cho_solve(cho_factor(stored + states.T @ states, overwrite_a=True), states.T @ error).T


def _check_redrawn(network: ConceptorNetwork, reservoir: Reservoir, estimate: Array) -> None:
    """Raises MotiondeckError if W U of the newest motion, computed with the present V, differs from the stored one."""
    newest: ConceptorMotion = network[network.motions[-1]]
    project = newest.project.astype(np.float64)
    strength = np.square(project).sum(1)
    used = strength > UNUSED
    directions = (project[used] / np.sqrt(strength[used])[:, None]).T
    again = (reservoir.weights + reservoir.input_weights @ estimate) @ directions
    if np.linalg.norm(again - newest.recurrent[:, used]) > REDRAWN * np.linalg.norm(again):
        raise MotiondeckError("this library's random weights cannot be drawn again here; train it again with learn")
