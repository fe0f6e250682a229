"""Loading motions into a reservoir and computing their conceptors (Deliallisi 2017, eqs 3.8 - 3.13).

Instead of a whole new W (eq. 3.12) the rule learned here is  W = W* + W_in V,  where V predicts the driving signal from
the state: the same regression restricted to what the input can do. It needs C N instead of N^2 numbers and plays as
well.
"""

from __future__ import annotations

import msgspec
import numpy as np
from scipy.linalg import eigh

from controller.generators.conceptor import ConceptorMotion, ConceptorNetwork
from controller.generators.reservoir import Reservoir, drive, random_reservoir
from controller.mocap.normalisation import Normalisation
from controller.rotations import Array
from controller.training.lesson import Lesson
from controller.training.ridge import ridge


class ConceptorRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, tag="conceptor"):
    """The parameters of a conceptor network (names as in Deliallisi 2017, table 4.3).

    Attributes:
        neurons: N.
        spectral_radius: of W*.
        input_scale, bias_scale: of W_in and b.
        aperture: alpha, for every motion.
        ridge: gamma of both regressions.
        rank: k, how many directions of a conceptor are kept.
        washout: frames until the state has forgotten its start.
        anchor_every: frames between the states that are stored for starting.
    """

    neurons: int = 1000
    spectral_radius: float = 1.6
    input_scale: float = 1.0
    bias_scale: float = 0.8
    aperture: float = 10.0
    ridge: float = 1.0
    rank: int = 50
    washout: int = 100
    anchor_every: int = 2


def train_conceptors(
    lessons: list[Lesson], normalisation: Normalisation, recipe: ConceptorRecipe, seed: int
) -> ConceptorNetwork:
    """One network that holds all lessons.

    Args:
        lessons: what to learn.
        normalisation: between the lessons' channels and the encoding's units; it goes into the readout.
        recipe: sizes and scales.
        seed: of everything random.
    """
    rng = np.random.default_rng(seed)
    reservoir = random_reservoir(
        recipe.neurons,
        lessons[0].frames.shape[1],
        spectral_radius=recipe.spectral_radius,
        input_scale=recipe.input_scale,
        bias_scale=recipe.bias_scale,
        rng=rng,
    )
    signals = [np.concatenate([lesson.lead_in(recipe.washout), lesson.frames]) for lesson in lessons]
    driven = drive(reservoir, signals)
    states, before, inputs = [], [], []
    for lesson, x in zip(lessons, driven, strict=True):
        states.append(x[recipe.washout :])
        before.append(x[recipe.washout - 1 : -1])
        inputs.append(lesson.frames)
    predict_input = ridge(np.concatenate(before), np.concatenate(inputs), recipe.ridge)
    readout = ridge(np.concatenate(states), np.concatenate(inputs), recipe.ridge)
    return ConceptorNetwork(
        {
            lesson.name: _motion(x, reservoir, predict_input, readout, normalisation, recipe)
            for lesson, x in zip(lessons, states, strict=True)
        }
    )


def _motion(
    states: Array,
    reservoir: Reservoir,
    predict_input: Array,
    readout: Array,
    normalisation: Normalisation,
    recipe: ConceptorRecipe,
) -> ConceptorMotion:
    """The affine conceptor of one motion's states (T, N), cut to its first k directions."""
    mean = states.mean(0)
    centred = states - mean
    gram = centred @ centred.T / len(reservoir)
    rank = min(recipe.rank, len(states) - 1)
    values, vectors = eigh(gram, subset_by_index=(len(states) - rank, len(states) - 1))
    values, vectors = values[::-1], vectors[:, ::-1]
    directions = centred.T @ vectors / np.sqrt(len(reservoir) * np.maximum(values, 1e-12))
    singular = values / (values + recipe.aperture**-2)
    recurrent = reservoir.weights @ directions + reservoir.input_weights @ (predict_input @ directions)
    bias = reservoir.weights @ mean + reservoir.input_weights @ (predict_input @ mean) + reservoir.bias
    project = singular[:, None] * directions.T
    # Going back to the encoding's units is affine, so it can be part of the readout.
    zero = normalisation.invert(np.zeros(len(readout)))
    channels = (normalisation.invert((readout @ directions).T) - zero).T
    rest = normalisation.invert(readout @ mean)
    return ConceptorMotion(
        *(
            np.ascontiguousarray(a, dtype=np.float32)
            for a in (
                recurrent,
                bias,
                project,
                project @ mean,
                channels,
                rest,
                (centred @ directions)[:: recipe.anchor_every],
            )
        )
    )
