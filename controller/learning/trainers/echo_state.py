"""Trains echo-state networks: teacher forcing and one ridge readout a motion (Deliallisi 2017, section 3.3.2).

Every motion is driven several times with noise on the state and on the forced output, so that the readout learns to
return from small errors; without it many motions drift off or freeze when they run free.

The best noise depends on the motion and on the random weights. So, with `choose_noise`, a motion that fails its trials
is trained again alone with other noise; no readout depends on another.
"""

from collections.abc import Sequence

import msgspec
import numpy as np

from controller.learning.measures.disturbance import Kind, failures
from controller.learning.measures.self_test import Judge
from controller.learning.preparation.training_motion import Lessons, TrainingMotion
from controller.learning.trainers.trainer import NewMotion, SettledNetwork, Trainer
from controller.motion.rotations import Array
from controller.networks.echo_state.network import EchoStateMotion, EchoStateNetwork
from controller.networks.reservoirs.reservoir import Floats, Reservoir, drive, random_reservoir
from controller.networks.ridge import ridge

# Training frames of a run from a random state; after them it is an ordinary noisy run.
LOST_FOR = 120


class EchoStateRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, tag="echo-state"):
    """The parameters of an echo-state network (names as in Deliallisi 2017, table 4.1)."""

    neurons: int = 1000  # N
    spectral_radius: float = 1.0  # of W
    feedback_scale: float = 1.0  # of W_back
    bias_scale: float = 0.3  # of b
    leak: float = 0.6  # a
    ridge: float = 0.5  # gamma
    washout: int = 100  # frames until the state is independent of its start
    state_noise: float = 0.03  # standard deviation, in units of the state
    teacher_noise: float = 0.02  # standard deviation, in units of the normalised output
    choose_noise: bool = False  # whether a motion that fails its trials is trained again with other noise
    drives: int = 3  # number of noisy runs
    wrong_starts: int = 0  # number of further runs of one-shots from a random state
    clipped: bool = True  # whether state and output stay in the range of training when the network runs free
    anchor_every: int = 8  # frames between stored start states


def learn_readouts(
    reservoir: Reservoir, to_learn: Sequence[TrainingMotion], recipe: EchoStateRecipe, rng: np.random.Generator
) -> dict[str, EchoStateMotion]:
    """A readout for each motion, independent of the others (eq. 2.4)."""
    targets = [np.concatenate([motion.lead_in(recipe.washout), motion.frames]) for motion in to_learn]
    # The state after step n has the feedback of frame n - 1 and predicts frame n.
    forced = [np.concatenate([target[:1], target[:-1]]) for target in targets]
    driven = reservoir.single()
    quiet = drive(driven, forced)
    first = [len(target) - len(motion.frames) for target, motion in zip(targets, to_learn, strict=True)]
    runs: list[list[tuple[Floats, Array]]] = [[] for _ in to_learn]  # states and target frames of noisy runs
    signals: list[Array] = []
    starts: list[Floats] = []
    asked: list[tuple[int, Array]] = []
    for j, motion in enumerate(to_learn):
        signal, count, lost = forced[j][first[j] :], recipe.drives, 0 if motion.loop else recipe.wrong_starts
        signals += [signal] * count + [signal[:LOST_FOR]] * lost
        starts += [quiet[j][first[j] - 1]] * count + [*rng.uniform(-1.0, 1.0, (lost, len(driven)))]
        asked += [(j, motion.frames)] * count + [(j, motion.frames[:LOST_FOR])] * lost
    if recipe.state_noise or recipe.teacher_noise:
        noisy = [signal + recipe.teacher_noise * rng.standard_normal(signal.shape) for signal in signals]
        states = drive(driven, noisy, state_noise=recipe.state_noise, starts=np.stack(starts), rng=rng)
        for (j, frames), run in zip(asked, states, strict=True):
            runs[j].append((run, frames))
    motions = {}
    for j, motion in enumerate(to_learn):
        learned, wanted = zip(*(runs[j] or [(quiet[j][first[j] :], motion.frames)]), strict=True)
        anchors = slice(first[j], None, recipe.anchor_every)
        readout = ridge(np.concatenate(learned, dtype=np.float64), np.concatenate(wanted), recipe.ridge)
        begins, outputs = quiet[j][anchors].copy(), targets[j][anchors].astype(np.float32)
        motions[motion.name] = EchoStateMotion(readout.astype(np.float32), begins, outputs)
    return motions


FACTORS = (1.0, 2.0, 0.4, 1.4)
"""Factors on the recipe's state noise, in the order of the trials; with 1 it is drawn anew."""


class EchoStateTrainer(Trainer[EchoStateRecipe]):
    """Learns a readout for each motion by teacher forcing."""

    recipe = EchoStateRecipe

    def train(self, recipe: EchoStateRecipe, lessons: Lessons, seed: int) -> EchoStateNetwork:
        to_learn = lessons.motions
        rng = np.random.default_rng(seed)
        scales = recipe.spectral_radius, recipe.feedback_scale, recipe.bias_scale
        outputs = to_learn[0].frames.shape[1]
        reservoir = random_reservoir(recipe.neurons, outputs, *scales, leak=recipe.leak, rng=rng).single()
        motions = learn_readouts(reservoir, to_learn, recipe, rng)
        shared = reservoir.weights, reservoir.input_weights, reservoir.bias, reservoir.leak, lessons.normalisation
        return EchoStateNetwork(*shared, motions, clipped=recipe.clipped)

    def settle(self, recipe: EchoStateRecipe, lessons: Lessons, seed: int, judge: Judge) -> SettledNetwork:
        """The network of a recipe and the number of failed trials of each motion, if it chooses the noise."""
        # A motion that fails a trial gets the first noise with which it passes all, else that with the fewest failures.
        if not recipe.choose_noise:
            return super().settle(recipe, lessons, seed, judge)
        network = self.train(recipe, lessons, seed)
        left: dict[str, int] = {}
        reservoir = Reservoir(network.weights, network.feedback, network.bias, network.leak)
        for motion in lessons.motions:
            # A loop that survives noise in every step survives a wrong start too; a one-shot always loses its phase
            # under such noise.
            kinds: tuple[Kind, ...] = ("stability",) if motion.loop else ("robustness",)
            fewest = failures(network, motion.name, kinds, judge, seed)
            for attempt, factor in enumerate(FACTORS):
                if fewest == 0:
                    break
                other = msgspec.structs.replace(recipe, state_noise=factor * recipe.state_noise)
                rng = np.random.default_rng([seed, *motion.name.encode(), attempt])
                trained_again = network.with_motions(learn_readouts(reservoir, [motion], other, rng))
                failed = failures(trained_again, motion.name, kinds, judge, seed)
                if failed < fewest:
                    fewest, network = failed, trained_again
            left[motion.name] = fewest
        return SettledNetwork(network, left)

    def add(self, recipe: EchoStateRecipe, network: EchoStateNetwork, motion: NewMotion) -> EchoStateNetwork:
        reservoir = Reservoir(network.weights, network.feedback, network.bias, network.leak)
        # The noise is the same whenever this motion is added in this place.
        rng = np.random.default_rng([motion.seed, len(motion.lengths)])
        part = learn_readouts(reservoir, [motion.scaled(network.normalisation)], recipe, rng)
        return network.with_motions(part)


TRAINER = EchoStateTrainer()
