"""Teaching an echo-state network: teacher forcing and one ridge readout a motion (Deliallisi 2017, section 3.3.2).

Every motion is driven several times with a little noise on the state and on the forced output, so that the readout has
seen what small errors look like and leads back from them; without it many motions drift off or freeze when they run
free.
"""

from __future__ import annotations

import msgspec
import numpy as np

from controller.learning.preparation.training_motion import TrainingMotion
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array
from controller.networks.echo_state.network import EchoStateMotion, EchoStateNetwork
from controller.networks.reservoirs.reservoir import Floats, Reservoir, drive, random_reservoir
from controller.networks.ridge import ridge

# How long a run that began in a random state is learned from, in frames; by then it is an ordinary noisy run.
LOST_FOR = 120


class EchoStateRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, tag="echo-state"):
    """The parameters of an echo-state network (names as in Deliallisi 2017, table 4.1).

    Attributes:
        neurons: N.
        spectral_radius, feedback_scale, bias_scale: of W, W_back and b.
        leak: a.
        ridge: gamma.
        washout: frames until the state has forgotten its start.
        state_noise, teacher_noise: standard deviations, in units of the state and of the normalised output.
        choose_noise: whether a motion that fails with it is taught with others (`learning/reservoirs/noise_choice.py`).
        drives: how many noisy runs are learned from.
        wrong_starts: how many further runs of one-shots begin at their first frame in a random
            state.
        clipped: whether state and output are kept in the range of training when the network runs free.
        anchor_every: frames between the states that are stored for starting.
    """

    neurons: int = 1000
    spectral_radius: float = 1.0
    feedback_scale: float = 1.0
    bias_scale: float = 0.3
    leak: float = 0.6
    ridge: float = 0.5
    washout: int = 100
    state_noise: float = 0.03
    teacher_noise: float = 0.02
    choose_noise: bool = False
    drives: int = 3
    wrong_starts: int = 0
    clipped: bool = True
    anchor_every: int = 8


def train_echo_state(
    to_learn: list[TrainingMotion], normalisation: Normalisation, recipe: EchoStateRecipe, seed: int
) -> EchoStateNetwork:
    """One network that holds all motions.

    Args:
        to_learn: the motions.
        normalisation: between their channels and the encoding's units.
        recipe: sizes and scales.
        seed: of everything random.
    """
    rng = np.random.default_rng(seed)
    reservoir = random_reservoir(
        recipe.neurons,
        to_learn[0].frames.shape[1],
        spectral_radius=recipe.spectral_radius,
        input_scale=recipe.feedback_scale,
        bias_scale=recipe.bias_scale,
        rng=rng,
        leak=recipe.leak,
    )
    motions = learn_readouts(reservoir, to_learn, recipe, rng)
    return EchoStateNetwork(
        reservoir.weights.astype(np.float32),
        reservoir.input_weights.astype(np.float32),
        reservoir.bias.astype(np.float32),
        recipe.leak,
        normalisation,
        motions,
        clipped=recipe.clipped,
    )


def learn_readouts(
    reservoir: Reservoir, to_learn: list[TrainingMotion], recipe: EchoStateRecipe, rng: np.random.Generator
) -> dict[str, EchoStateMotion]:
    """A readout for each motion; none of them depends on the others (eq. 2.4)."""
    targets = [np.concatenate([motion.lead_in(recipe.washout), motion.frames]) for motion in to_learn]
    # The state after step n has been fed the output of frame n - 1 and is to give frame n.
    forced = [np.concatenate([target[:1], target[:-1]]) for target in targets]
    driven = reservoir.single()
    quiet = drive(driven, forced)
    first = [len(target) - len(motion.frames) for target, motion in zip(targets, to_learn, strict=True)]
    runs = _noisy_runs(driven, to_learn, forced, quiet, recipe, rng)
    motions = {}
    for j, motion in enumerate(to_learn):
        learned, wanted = zip(*(runs[j] or [(quiet[j][first[j] :], motion.frames)]), strict=True)
        anchors = slice(first[j], None, recipe.anchor_every)
        motions[motion.name] = EchoStateMotion(
            ridge(np.concatenate(learned, dtype=np.float64), np.concatenate(wanted), recipe.ridge).astype(np.float32),
            quiet[j][anchors].copy(),
            targets[j][anchors].astype(np.float32),
        )
    return motions


def _noisy_runs(
    driven: Reservoir,
    to_learn: list[TrainingMotion],
    forced: list[Array],
    quiet: list[Floats],
    recipe: EchoStateRecipe,
    rng: np.random.Generator,
) -> list[list[tuple[Floats, Array]]]:
    """The states and the frames to be learned from them, of the noisy runs of each motion; none without noise."""
    if recipe.state_noise == recipe.teacher_noise == 0.0:
        return [[] for _ in to_learn]
    signals: list[Array] = []
    starts: list[Floats] = []
    wanted: list[tuple[int, Array]] = []
    for j, motion in enumerate(to_learn):
        first = len(forced[j]) - len(motion.frames)
        for _ in range(recipe.drives):
            signals.append(forced[j][first:])
            starts.append(quiet[j][first - 1])
            wanted.append((j, motion.frames))
        for _ in range(0 if motion.loop else recipe.wrong_starts):
            signals.append(forced[j][first:][:LOST_FOR])
            starts.append(rng.uniform(-1.0, 1.0, len(driven)))
            wanted.append((j, motion.frames[:LOST_FOR]))
    noisy = [signal + recipe.teacher_noise * rng.standard_normal(signal.shape) for signal in signals]
    states = drive(driven, noisy, state_noise=recipe.state_noise, starts=np.stack(starts), rng=rng)
    runs: list[list[tuple[Floats, Array]]] = [[] for _ in to_learn]
    for (j, frames), run in zip(wanted, states, strict=True):
        runs[j].append((run, frames))
    return runs
