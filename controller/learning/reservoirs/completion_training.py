"""Trains the reconstruction of unmeasured channels: ridge regression on a reservoir driven by the measured ones."""

from collections.abc import Sequence

import msgspec
import numpy as np

from controller.motion.rotations import Array
from controller.networks.reservoirs.completion import Completion
from controller.networks.reservoirs.reservoir import drive, random_reservoir
from controller.networks.ridge import affine_ridge
from controller.networks.signals import number_within, sampling_rate, time_series, whole_number
from motiondeck_base.errors import MotiondeckError

SETTLING_SECONDS = 1.0


class CompletionRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The parameters; the defaults were chosen on jogs, sneaks and walks (docs/networks.md)."""

    neurons: int = 600  # N
    spectral_radius: float = 0.9  # of W; with 0, and `memory_seconds` 0, only the present measurement counts
    memory_seconds: float = 0.06  # time constant of the neurons, s
    input_scale: float = 0.7  # of W_in, for one channel of deviation 1; it shrinks with the square root of their number
    bias_scale: float = 0.5  # of b
    ridge: float = 0.01  # gamma of the regression, per training frame

    def leak(self, rate: float) -> float:
        """The leak a of neurons with a time constant of `memory_seconds` at a rate, Hz."""
        return 1.0 - float(np.exp(-1.0 / (rate * self.memory_seconds))) if self.memory_seconds > 0.0 else 1.0


def learn_completion(
    examples: Sequence[tuple[Array, Array]], rate: float, *, recipe: CompletionRecipe | None = None, seed: int = 0
) -> Completion:
    """Trains the reconstruction of all channels (T, D) from measured ones (T, C) at a rate, Hz.

    Examples are measured and all channels of each recording; for noisy measurements give noisy ones. MotiondeckError if
    there is none, shapes do not fit, a number is not finite, or the rate is invalid.
    """
    if len(examples) == 0:
        raise MotiondeckError("there are no recordings to learn to complete a body from")
    recipe, hertz, drawn_with = recipe or CompletionRecipe(), sampling_rate(rate), whole_number(seed, "seed")
    number_within(recipe.memory_seconds, "memory_seconds", 0.0, 1e6)
    given: list[Array] = []
    wanted: list[Array] = []
    for index, example in enumerate(examples):
        if not isinstance(example, (tuple, list)) or len(example) != 2:  # what pyright sees, a user's script does not
            raise MotiondeckError(f"recording {index}: give a pair, what is measured (T, C) and the whole (T, D)")
        part, whole = example
        given.append(time_series(part, f"what is measured in recording {index}", given[0].shape[1] if given else None))
        wanted.append(time_series(whole, f"recording {index}", wanted[0].shape[1] if wanted else None))
        if len(given[-1]) != len(wanted[-1]):
            raise MotiondeckError(f"recording {index}: {len(given[-1])} measured and {len(wanted[-1])} whole frames")
    together = np.concatenate(given)
    mean, deviation = together.mean(0), together.std(0)
    deviation = np.where(deviation > 1e-6 * max(float(deviation.max()), 1e-12), deviation, 1.0)
    scales = recipe.spectral_radius, recipe.input_scale / np.sqrt(len(mean)), recipe.bias_scale
    reservoir = random_reservoir(recipe.neurons, len(mean), *scales, leak=recipe.leak(hertz), seed=drawn_with)
    settling = round(SETTLING_SECONDS * hertz)
    signals = [(part - mean) / deviation for part in given]
    driven = drive(reservoir, [np.concatenate([np.repeat(one[:1], settling, axis=0), one]) for one in signals])
    states = np.column_stack([np.concatenate([one[settling:] for one in driven]), np.concatenate(signals)])
    targets = np.concatenate(wanted)
    gamma = number_within(recipe.ridge, "ridge", 0.0, 1e9) * len(states)
    return Completion(reservoir, mean, deviation, affine_ridge(states, targets, gamma), hertz, settling)
