"""Teaching random feature conceptors: conception weights online, while the looped motion drives (Jaeger 2014, 3.15).

Every motion is given k of the M features at random and driven round and round. With z_i = f_i' r its weights follow

    c_i(n+1) = c_i(n) + lambda ((1 - c_i(n)) (z_i(n) - m_i(n))^2 - aperture^-2 c_i(n)),

which comes to rest, on average, at c_i = phi_i / (phi_i + aperture^-2), phi_i being the energy of a feature about its
mean m_i, learned alike. Nothing but a feature's own signal is needed for it. The recordings are short, which is why
the thesis could not do it (section 6); a closed loop is as long as one likes.

Then V, which predicts the driving signal, and W_out are ridge regressions over all motions, and the network runs with
G + W_in V. Noise on the state and on the signal while they are gathered teaches both to lead back from small errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np
from scipy.linalg import cho_factor, cho_solve

from controller.learning.preparation.training_motion import TrainingMotion
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array
from controller.networks.random_feature.network import (
    FeatureMotion,
    FeatureReservoir,
    Float32,
    RandomFeatureNetwork,
)
from controller.networks.reservoirs.reservoir import largest_eigenvalue
from motiondeck_base.errors import MotiondeckError

# How long the means are learned before the weights begin to follow, in frames.
SETTLING = 40

# Conception weights lie in [0, 1]; a step that is too large for the signal drives them past any bound.
DIVERGED = 10.0


class RandomFeatureRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, tag="random-feature"):
    """The parameters of random feature conceptors.

    Attributes:
        neurons: N.
        features: M.
        features_each: k, how many of them a motion uses.
        spectral_radius: of the loop through the features that a motion uses.
        input_scale, bias_scale: of W_in and b.
        aperture: alpha.
        learning_rate: lambda.
        adapt_frames: how long a motion drives while its weights are learned; at least twice round.
        ridge: gamma of both regressions.
        washout: frames until the state has forgotten its start.
        state_noise, teacher_noise: standard deviations, in units of the state and of the normalised signal.
        drives: how many noisy runs are learned from, beside the quiet one.
        anchor_every: frames between the states that are stored for starting.
    """

    neurons: int = 1000
    features: int = 3000
    features_each: int = 300
    spectral_radius: float = 1.0
    input_scale: float = 0.8
    bias_scale: float = 0.8
    aperture: float = 10.0
    learning_rate: float = 0.02
    adapt_frames: int = 400
    ridge: float = 0.1
    washout: int = 100
    state_noise: float = 0.03
    teacher_noise: float = 0.04
    drives: int = 4
    anchor_every: int = 4


@dataclass(frozen=True)
class Drawn:
    """What is random and never learned.

    Attributes:
        features, feedback: F' and G', shape (M, N).
        inputs: W_in, shape (N, C).
        bias: b, shape (N,).
        uses: the features of each motion, each of shape (k,).
    """

    features: Float32
    feedback: Float32
    inputs: Float32
    bias: Float32
    uses: list[np.ndarray]


def train_random_features(
    to_learn: list[TrainingMotion], normalisation: Normalisation, recipe: RandomFeatureRecipe, seed: int
) -> RandomFeatureNetwork:
    """One network that holds all motions.

    Args:
        to_learn: the motions.
        normalisation: between their channels and the encoding's units; it goes into the readout.
        recipe: sizes and scales.
        seed: of everything random.
    """
    rng = np.random.default_rng(seed)
    drawn = draw(recipe, to_learn[0].frames.shape[1], len(to_learn), rng)
    regressions = [_Regression(recipe.features, to_learn[0].frames.shape[1]) for _ in range(2)]
    motions = {}
    for motion, uses in zip(to_learn, drawn.uses, strict=True):
        signal = (motion.frames @ drawn.inputs.T + drawn.bias).astype(np.float32)
        features, feedback = drawn.features[uses], drawn.feedback[uses]
        conception, mean = conceive(signal, features, feedback, recipe)
        offset = (1.0 - conception) * mean
        before, after = _harvest(motion, drawn, features, feedback, conception, offset, recipe, rng)
        for regression, states in zip(regressions, (before, after), strict=True):
            regression.learn(uses, states.reshape(-1, len(uses)), np.repeat(motion.frames, states.shape[1], axis=0))
        quiet = np.ascontiguousarray(after[:: recipe.anchor_every, 0])
        motions[motion.name] = FeatureMotion(uses, conception, offset, quiet)
    estimate, readout = (regression.solved(recipe.ridge) for regression in regressions)
    # Going back to the encoding's units is affine, so it can be part of the readout.
    zero = normalisation.invert(np.zeros(readout.shape[1]))
    reservoir = FeatureReservoir(
        drawn.features,
        drawn.feedback + (estimate @ drawn.inputs.T).astype(np.float32),
        drawn.bias,
        (normalisation.invert(readout) - zero).astype(np.float32),
        zero.astype(np.float32),
    )
    return RandomFeatureNetwork(reservoir, motions)


def draw(recipe: RandomFeatureRecipe, channels: int, motions: int, rng: np.random.Generator) -> Drawn:
    """Features of length 1 and weights from U[-1, 1], scaled; and which features each motion is to use."""
    size, many, each = recipe.neurons, recipe.features, recipe.features_each
    features = rng.standard_normal((many, size), dtype=np.float32)
    features /= np.linalg.norm(features, axis=1)[:, None]
    feedback = rng.uniform(-1.0, 1.0, (many, size)).astype(np.float32)
    uses = [np.sort(rng.choice(many, each, replace=False)).astype(np.int32) for _ in range(motions)]
    loop: Array = (feedback[uses[0]] @ features[uses[0]].T).astype(np.float64)
    feedback *= recipe.spectral_radius / largest_eigenvalue(loop, rng)
    inputs = recipe.input_scale * rng.uniform(-1.0, 1.0, (size, channels))
    bias = recipe.bias_scale * rng.uniform(-1.0, 1.0, size)
    return Drawn(features, feedback, inputs.astype(np.float32), bias.astype(np.float32), uses)


def conceive(
    signal: Float32, features: Float32, feedback: Float32, recipe: RandomFeatureRecipe
) -> tuple[Float32, Float32]:
    """The conception weights and means that a looped signal leaves, each of shape (k,).

    Args:
        signal: W_in p + b of each frame, shape (T, N).
        features, feedback: of the features that are used, shape (k, N).
        recipe: aperture, rate and duration of learning.

    Raises:
        MotiondeckError: if they do not come to rest.
    """
    rate, leak = recipe.learning_rate, recipe.aperture**-2
    z, mean = (np.zeros(len(features), dtype=np.float32) for _ in range(2))
    c = np.ones_like(z)
    for n in range(recipe.washout + max(recipe.adapt_frames, 2 * len(signal))):
        seen = z = features @ np.tanh(z @ feedback + signal[n % len(signal)])
        learned = n - recipe.washout
        if learned >= 0:
            mean += max(0.25 * rate, 1.0 / (learned + 1)) * (seen - mean)
            apart = seen - mean
            if learned >= SETTLING:
                c += rate * ((1.0 - c) * np.square(apart) - leak * c)
            z = mean + c * apart
            if not np.abs(c).max() < DIVERGED:
                raise MotiondeckError(
                    f"the conception weights do not come to rest with network.learning_rate = {rate} and "
                    f"network.aperture = {recipe.aperture}; give a smaller learning_rate or a larger aperture"
                )
    return np.clip(c, 0.0, 1.0), mean


def _harvest(
    motion: TrainingMotion,
    drawn: Drawn,
    features: Float32,
    feedback: Float32,
    conception: Float32,
    offset: Float32,
    recipe: RandomFeatureRecipe,
    rng: np.random.Generator,
) -> tuple[Float32, Float32]:
    """z before and after each frame of a motion, each of shape (T, 1 + drives, k); the first run is quiet."""
    lead_in = motion.lead_in(recipe.washout)
    signal = (np.concatenate([lead_in, motion.frames]) @ drawn.inputs.T + drawn.bias).astype(np.float32)
    noise = np.ones((1 + recipe.drives, 1), dtype=np.float32)
    noise[0] = 0.0
    z = np.repeat(offset[None], len(noise), axis=0)
    before = np.empty((len(motion.frames), *z.shape), dtype=np.float32)
    after = np.empty_like(before)
    for n, heard in enumerate(signal):
        hidden = z @ feedback + heard
        wrong = rng.standard_normal((len(noise), drawn.inputs.shape[1]), dtype=np.float32)
        hidden += recipe.teacher_noise * noise * (wrong @ drawn.inputs.T)
        np.tanh(hidden, out=hidden)
        hidden += recipe.state_noise * noise * rng.standard_normal(hidden.shape, dtype=np.float32)
        was, z = z, conception * (hidden @ features.T) + offset
        if n >= len(lead_in):
            before[n - len(lead_in)], after[n - len(lead_in)] = was, z
    return before, after


class _Regression:
    """A ridge regression on M features of which every motion uses few, so that its normal matrix fills blockwise."""

    def __init__(self, features: int, channels: int) -> None:
        self._gram, self._moment = np.zeros((features, features)), np.zeros((features, channels))

    def learn(self, uses: np.ndarray, states: Float32, targets: Array) -> None:
        """Takes in states (T, k) of the features that are used, and what they are to say, shape (T, C)."""
        exact = states.astype(np.float64)
        self._gram[np.ix_(uses, uses)] += exact.T @ exact
        self._moment[uses] += exact.T @ targets

    def solved(self, regulariser: float) -> Array:
        """The weights, shape (M, C)."""
        self._gram[np.diag_indices(len(self._gram))] += regulariser
        return cho_solve(cho_factor(self._gram, overwrite_a=True), self._moment)
