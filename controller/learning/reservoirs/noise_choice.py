"""How much noise while an echo-state network is taught which motion? As much as makes it hold in trials.

A little noise on the state teaches a readout the way back from small errors. How much is best depends on the motion and
on the random weights, and the draw itself decides where a motion is near to freezing; so a motion that does not hold is
taught again alone, since no readout depends on another.
"""

from __future__ import annotations

import msgspec
import numpy as np

from controller.learning.measures.disturbance import Kind
from controller.learning.measures.self_test import Judge
from controller.learning.measures.trials import failures
from controller.learning.preparation.training_motion import TrainingMotion
from controller.learning.reservoirs.echo_state_training import EchoStateRecipe, learn_readouts, train_echo_state
from controller.motion.encodings.normalisation import Normalisation
from controller.networks.echo_state.network import EchoStateNetwork
from controller.networks.reservoirs.reservoir import Reservoir

FACTORS = (1.0, 2.0, 0.4, 1.4)
"""What the recipe's state noise is multiplied by, in the order in which it is tried; with 1 it is drawn anew."""

# What a motion has to survive. A loop that survives noise in every step survives a wrong start too; a one-shot
# loses its place under such noise, whatever it was taught.
LOOP: tuple[Kind, ...] = ("stability",)
ONCE: tuple[Kind, ...] = ("robustness",)


def settled_echo_state(
    to_learn: list[TrainingMotion], normalisation: Normalisation, recipe: EchoStateRecipe, judge: Judge, seed: int
) -> tuple[EchoStateNetwork, dict[str, int]]:
    """The network of a recipe and how many runs of each motion fail.

    A motion that fails a trial gets the first noise with which it does not; where there is none, what failed least.

    Args:
        to_learn, normalisation, recipe: as for `train_echo_state`.
        judge: of the motions.
        seed: of everything random.
    """
    network = train_echo_state(to_learn, normalisation, recipe, seed)
    left: dict[str, int] = {}
    reservoir = Reservoir(network.weights, network.feedback, network.bias, network.leak)
    for motion in to_learn:
        kinds = LOOP if motion.loop else ONCE
        fewest = failures(network, motion.name, kinds, judge, seed)
        for attempt, factor in enumerate(FACTORS):
            if fewest == 0:
                break
            other = msgspec.structs.replace(recipe, state_noise=factor * recipe.state_noise)
            rng = np.random.default_rng([seed, *motion.name.encode(), attempt])
            taught_again = network.with_motions(learn_readouts(reservoir, [motion], other, rng))
            failed = failures(taught_again, motion.name, kinds, judge, seed)
            if failed < fewest:
                fewest, network = failed, taught_again
        left[motion.name] = fewest
    return network, left
