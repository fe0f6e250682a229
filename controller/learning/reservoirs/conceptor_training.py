"""Loads motions into a reservoir and computes their conceptors (Deliallisi 2017, eqs 3.8 - 3.13).

Two ways to internalise the input, so that the network runs without it:

- "weights", as in the thesis: a new W by ridge regression on  W* x(n-1) + W_in p(n)  (eqs 3.11, 3.12);
- "input":  W = W* + W_in V,  where V predicts the driving signal from the state: the same regression restricted to the
  effect of the input. It needs C N instead of N^2 numbers and plays equally well.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import msgspec
import numpy as np
from scipy.linalg import eigh

from controller.learning.measures.self_test import distances
from controller.learning.preparation.training_motion import Lessons, TrainingMotion
from controller.motion.encodings.encoding import Encoding
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array
from controller.networks.conceptor.network import ConceptorMotion, ConceptorNetwork
from controller.networks.reservoirs.reservoir import Reservoir, drive, random_reservoir
from controller.networks.ridge import ridge


class ConceptorRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, tag="conceptor"):
    """The parameters of a conceptor network (names as in Deliallisi 2017, table 4.3)."""

    neurons: int = 1000  # N
    spectral_radius: float = 1.6  # of W*
    input_scale: float = 1.0  # of W_in
    bias_scale: float = 0.8  # of b
    # "affine" conceptors act about the mean state of their motion, "plain" ones about zero.
    form: Literal["affine", "plain"] = "affine"
    learns: Literal["input", "weights"] = "input"  # "input" learns V only, "weights" all of W
    aperture: float = 10.0  # alpha, by default
    apertures: dict[str, float] = msgspec.field(default_factory=dict)  # alpha of single motions
    choose_apertures: bool = False  # whether a motion that fails its trials gets another one (`aperture_choice`)
    ridge: float = 1.0  # gamma of both regressions
    rank: int = 50  # k, the largest number of directions kept of a conceptor
    rank_tolerance_mm: float | None = None  # selects the smallest rank that `cut_to_tolerance` allows, mm
    washout: int = 100  # frames until the state is independent of its start
    anchor_every: int = 2  # frames between stored start states


@dataclass(frozen=True)
class LoadedReservoir:
    """A reservoir that reproduces its motions without input."""

    reservoir: Reservoir  # as drawn, with W*, W_in and b
    weights: Array  # W, shape (N, N)
    readout: Array  # W_out, shape (C, N)
    before: list[Array]  # states before each frame of each motion, shape (T_j, N)
    states: list[Array]  # states after it


def load_reservoir(to_learn: Sequence[TrainingMotion], recipe: ConceptorRecipe, seed: int) -> LoadedReservoir:
    """Drives a random reservoir with all motions and learns W and W_out (eqs 3.8 and 3.11 - 3.13)."""
    scales = recipe.spectral_radius, recipe.input_scale, recipe.bias_scale
    reservoir = random_reservoir(recipe.neurons, to_learn[0].frames.shape[1], *scales, seed=seed)
    driven = drive(reservoir, [np.concatenate([motion.lead_in(recipe.washout), motion.frames]) for motion in to_learn])
    states = [x[len(x) - len(motion.frames) :] for motion, x in zip(to_learn, driven, strict=True)]
    before = [x[len(x) - len(motion.frames) - 1 : -1] for motion, x in zip(to_learn, driven, strict=True)]
    was, inputs = np.concatenate(before), np.concatenate([motion.frames for motion in to_learn])
    readout = ridge(np.concatenate(states), inputs, recipe.ridge)
    if recipe.learns == "weights":
        weights = ridge(was, input_targets(reservoir, was, inputs), recipe.ridge)
    else:
        weights = reservoir.weights + reservoir.input_weights @ ridge(was, inputs, recipe.ridge)
    return LoadedReservoir(reservoir, weights, readout, before, states)


def input_targets(reservoir: Reservoir, before: Array, inputs: Array) -> Array:
    """D = W* x(n-1) + W_in p(n), shape (T, N): the targets of a new W (eq. 3.11)."""
    return before @ reservoir.weights.T + inputs @ reservoir.input_weights.T


def conceptor_network(loaded: LoadedReservoir, lessons: Lessons, recipe: ConceptorRecipe) -> ConceptorNetwork:
    """The network of all motions of a loaded reservoir."""
    normalisation, motions = lessons.normalisation, {}
    for motion, states in zip(lessons.motions, loaded.states, strict=True):
        aperture = recipe.apertures.get(motion.name, recipe.aperture)
        motions[motion.name] = conceptor_motion(states, loaded, normalisation, recipe, aperture)
    return ConceptorNetwork(motions)


def mean_state(states: Array, recipe: ConceptorRecipe) -> Array:
    """m, the center of a conceptor, from the states (T, N) of its motion."""
    return states.mean(0) if recipe.form == "affine" else np.zeros(states.shape[1])


def conceptor_motion(
    states: Array, loaded: LoadedReservoir, normalisation: Normalisation, recipe: ConceptorRecipe, aperture: float
) -> ConceptorMotion:
    """The conceptor of one motion's states (T, N), cut to its first k directions (eqs 3.9, 3.10)."""
    mean = mean_state(states, recipe)
    centred = states - mean
    values, directions = principal_directions(centred, recipe.rank)
    singular = values / (values + aperture**-2)
    project = singular[:, None] * directions.T
    # The inverse normalisation is affine and becomes part of the readout.
    zero = normalisation.invert(np.zeros(len(loaded.readout)))
    channels = (normalisation.invert((loaded.readout @ directions).T) - zero).T
    rest, states = normalisation.invert(loaded.readout @ mean), (centred @ directions)[:: recipe.anchor_every]
    recurrent, bias = loaded.weights @ directions, loaded.weights @ mean + loaded.reservoir.bias
    parts = recurrent, bias, project, project @ mean, channels, rest, states
    return ConceptorMotion(*(np.ascontiguousarray(part, dtype=np.float32) for part in parts))


def principal_directions(centred: Array, rank: int) -> tuple[Array, Array]:
    """The largest eigenvalues (k,) of R = X X' / N of states (T, N), and their directions U, shape (N, k)."""
    frames, neurons = centred.shape
    rank = min(rank, frames - 1, neurons)
    values, vectors = eigh(centred @ centred.T / neurons, subset_by_index=(frames - rank, frames - 1))
    values, vectors = np.maximum(values[::-1], 1e-12), vectors[:, ::-1]
    return values, centred.T @ vectors / np.sqrt(neurons * values)


def cut_to_tolerance(network: ConceptorNetwork, encoding: Encoding, tolerance_mm: float) -> ConceptorNetwork:
    """The network with all motions cut to the smallest rank within a tolerance of their joints, mm."""
    # From each stored state the full and the cut conceptor take one step, and the joints are compared. A run would not
    # do: two correct networks at slightly different tempos soon differ.
    parts = {name: network[name] for name in network.motions}
    parts = {name: cut(part, rank_within(part, encoding, tolerance_mm)) for name, part in parts.items()}
    return network.with_motions(parts)


def rank_within(part: ConceptorMotion, encoding: Encoding, tolerance_mm: float) -> int:
    """The smallest rank k >= 1 from which on the next frame of every stored state is within the tolerance, mm."""
    exact = _joints_after_a_step(part, len(part.offset), encoding)
    for rank in range(len(part.offset) - 1, 0, -1):
        if distances(exact, _joints_after_a_step(part, rank, encoding)).max() > tolerance_mm:
            return rank + 1
    return 1


def cut(part: ConceptorMotion, rank: int) -> ConceptorMotion:
    """A motion in its first `rank` directions."""
    by_column = ("recurrent", "readout", "states")
    kept = {name: np.ascontiguousarray(getattr(part, name)[:, :rank]) for name in by_column}
    return replace(part, project=part.project[:rank].copy(), offset=part.offset[:rank].copy(), **kept)


def _joints_after_a_step(part: ConceptorMotion, rank: int, encoding: Encoding) -> Array:
    """The joints one step after each stored state, playing in the first k directions, shape (A, F), mm."""
    hidden = np.tanh(part.states[:, :rank] @ part.recurrent[:, :rank].T + part.bias)
    z = hidden @ part.project[:rank].T - part.offset[:rank]
    return joint_features(encoding, (z @ part.readout[:, :rank].T + part.rest).astype(np.float64))
