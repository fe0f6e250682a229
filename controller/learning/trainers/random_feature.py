"""Trains random feature conceptors: conception weights online, while the looped motion drives (Jaeger 2014, 3.15).

Every motion gets k of the M features at random and drives the reservoir as a loop. With z_i = f_i' r its weights obey

    c_i(n+1) = c_i(n) + lambda ((1 - c_i(n)) (z_i(n) - m_i(n))^2 - aperture^-2 c_i(n)),

whose mean fixed point is c_i = phi_i / (phi_i + aperture^-2), with phi_i the energy of a feature about its mean m_i,
which is learned likewise. Only the feature's own signal is used. The recordings are short, which prevented it in the
thesis (section 6); a closed loop has any length.

Then V, which predicts the driving signal, and W_out are ridge regressions over all motions, and the network runs with
G + W_in V. Noise on state and signal during these runs teaches both to return from small errors.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
from scipy.linalg import cho_factor, cho_solve

from controller.learning.preparation.training_motion import Lessons, TrainingMotion
from controller.learning.trainers.trainer import Trainer, mabs
from controller.motion.rotations import Array
from controller.networks.random_feature.network import FeatureMotion, FeatureReservoir, Float32, RandomFeatureNetwork
from controller.networks.reservoirs.reservoir import largest_eigenvalue
from motiondeck_base.errors import MotiondeckError

SETTLING = 40  # frames in which only the means are learned
DIVERGED = 10.0  # conception weights are in [0, 1] unless the learning rate is too large for the signal


class RandomFeatureRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, tag="random-feature"):
    """The parameters of random feature conceptors."""

    neurons: int = 1000  # N
    features: int = 3000  # M
    features_each: int = 300  # k, number of features of a motion
    spectral_radius: float = 1.0  # of the loop through the features of a motion
    input_scale: float = 0.8  # of W_in
    bias_scale: float = 0.8  # of b
    aperture: float = 10.0  # alpha
    learning_rate: float = 0.02  # lambda
    adapt_frames: int = 400  # training frames of the conception weights; at least two rounds
    ridge: float = 0.1  # gamma of both regressions
    washout: int = 100  # frames until the state is independent of its start
    state_noise: float = 0.03  # standard deviation, in units of the state
    teacher_noise: float = 0.04  # standard deviation, in units of the normalised signal
    drives: int = 4  # number of noisy runs, besides one without noise
    anchor_every: int = 4  # frames between stored start states


@dataclass(frozen=True)
class RandomFeatures:
    """The random part, which is not trained."""

    features: Float32  # F', shape (M, N)
    feedback: Float32  # G', shape (M, N)
    inputs: Float32  # W_in, shape (N, C)
    bias: Float32  # b, shape (N,)
    uses: list[np.ndarray]  # the features of each motion, each of shape (k,)


def draw_features(recipe: RandomFeatureRecipe, channels: int, motions: int, rng: np.random.Generator) -> RandomFeatures:
    """Features of length 1, scaled weights from U[-1, 1], and the features of each motion."""
    size, many, each = recipe.neurons, recipe.features, recipe.features_each
    features = rng.standard_normal((many, size), dtype=np.float32)
    features /= np.linalg.norm(features, axis=1)[:, None]
    feedback = rng.uniform(-1.0, 1.0, (many, size)).astype(np.float32)
    uses = [np.sort(rng.choice(many, each, replace=False)).astype(np.int32) for _ in range(motions)]
    loop: Array = (feedback[uses[0]] @ features[uses[0]].T).astype(np.float64)
    feedback *= recipe.spectral_radius / largest_eigenvalue(loop, rng)
    inputs = recipe.input_scale * rng.uniform(-1.0, 1.0, (size, channels))
    bias = recipe.bias_scale * rng.uniform(-1.0, 1.0, size)
    return RandomFeatures(features, feedback, inputs.astype(np.float32), bias.astype(np.float32), uses)


def conception_weights(
    signal: Float32, features: Float32, feedback: Float32, recipe: RandomFeatureRecipe
) -> tuple[Float32, Float32]:
    """The conception weights and means of a looped signal W_in p + b (T, N), shape (k,) each.

    `features` and `feedback` are those of the motion, shape (k, N). MotiondeckError if the weights diverge.
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
    drawn: RandomFeatures,
    features: Float32,
    feedback: Float32,
    conception: Float32,
    offset: Float32,
    recipe: RandomFeatureRecipe,
    rng: np.random.Generator,
) -> tuple[Float32, Float32]:
    """z before and after each frame of a motion, shape (T, 1 + drives, k) each; the first run has no noise."""
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
    """A ridge regression on M features; each motion adds a block to the normal matrix."""

    def __init__(self, features: int, channels: int) -> None:
        self._gram, self._moment = np.zeros((features, features)), np.zeros((features, channels))

    def learn(self, uses: np.ndarray, states: Float32, targets: Array) -> None:
        """Adds states (T, k) of some features and their targets (T, C)."""
        exact = states.astype(np.float64)
        self._gram[np.ix_(uses, uses)] += exact.T @ exact
        self._moment[uses] += exact.T @ targets

    def solved(self, regulariser: float) -> Array:
        """The weights, shape (M, C)."""
        self._gram[np.diag_indices(len(self._gram))] += regulariser
        return cho_solve(cho_factor(self._gram, overwrite_a=True), self._moment)


class RandomFeatureTrainer(Trainer[RandomFeatureRecipe]):
    """Learns conception weights and two regressions for all motions at once."""

    recipe = RandomFeatureRecipe

    def problems(self, recipe: RandomFeatureRecipe, motions: Sequence[str]) -> Iterator[str]:
        if recipe.features_each > recipe.features:
            yield f"network.features_each is {recipe.features_each}, but network.features is {recipe.features}"
        # A feature's energy is hardly ever above 1, so a step in `conception_weights` shrinks the error of c.
        if recipe.aperture > 0.0 and recipe.learning_rate * (1.0 + recipe.aperture**-2) >= 1.0:
            yield (
                f"network.learning_rate = {recipe.learning_rate} is too large for network.aperture = "
                f"{recipe.aperture}: learning_rate * (1 + aperture^-2) has to stay below 1; learn slower or open wider"
            )

    def train(self, recipe: RandomFeatureRecipe, lessons: Lessons, seed: int) -> RandomFeatureNetwork:
        """One network of all motions; the normalisation becomes part of the readout."""
        to_learn, normalisation = lessons.motions, lessons.normalisation
        rng = np.random.default_rng(seed)
        drawn = draw_features(recipe, to_learn[0].frames.shape[1], len(to_learn), rng)
        regressions = [_Regression(recipe.features, to_learn[0].frames.shape[1]) for _ in range(2)]
        motions = {}
        for motion, uses in zip(to_learn, drawn.uses, strict=True):
            signal = (motion.frames @ drawn.inputs.T + drawn.bias).astype(np.float32)
            features, feedback = drawn.features[uses], drawn.feedback[uses]
            conception, mean = conception_weights(signal, features, feedback, recipe)
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

    def readout_size(self, network: RandomFeatureNetwork, scaling: Array) -> float:
        return mabs(network.reservoir.readout * scaling)


TRAINER = RandomFeatureTrainer()
