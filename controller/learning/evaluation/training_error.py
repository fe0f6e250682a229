"""How well a recipe's networks learn: the figures under tables 4.1, 4.3 and 4.5 of Deliallisi 2017, for any recipe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from controller.learning.centralized.centralized_training import CentralizedRecipe, train_centralized_network
from controller.learning.measures.accuracy import mabs, nrmse
from controller.learning.measures.self_test import Judge
from controller.learning.recipe import LibraryRecipe
from controller.learning.reservoirs.aperture_choice import settled_network
from controller.learning.reservoirs.conceptor_training import load_reservoir, what_drove
from controller.learning.reservoirs.echo_state_training import EchoStateRecipe, train_echo_state
from controller.learning.reservoirs.noise_choice import settled_echo_state
from controller.learning.reservoirs.phase_training import PhaseDrivenRecipe, train_phase_driven
from controller.learning.reservoirs.random_feature_training import RandomFeatureRecipe, train_random_features
from controller.learning.training_set import TrainingSet
from controller.library.network_arrays import AnyNetwork, PhaseDriven
from controller.motion.rotations import Array
from controller.networks.centralized.centralized_frames import CentralizedNetwork
from controller.networks.ridge import ridge


@dataclass(frozen=True)
class TrainingError:
    """The result of one seed.

    Attributes:
        seed: of the network.
        mabs_readout, nrmse_readout: of W_out; for echo-state and centralized networks means over the motions, whose
            readouts differ.
        mabs_weights, nrmse_weights: of W, where it was learned in full.
        network: that was trained.
    """

    seed: int
    mabs_readout: float
    nrmse_readout: float
    mabs_weights: float | None
    nrmse_weights: float | None
    network: AnyNetwork


def training_error(
    recipe: LibraryRecipe, syllabus: TrainingSet, seed: int, readout_targets: Sequence[Array] | None = None
) -> TrainingError:
    """Trains a recipe with a seed and measures it.

    Args:
        recipe: what to train.
        syllabus: its frames.
        seed: of everything random.
        readout_targets: what the readout of a conceptor network learns, one (T, channels) a motion; its frames if None.
    """
    lessons, normalisation = syllabus.normalised()
    plan = recipe.network
    judge = Judge(syllabus.encoding, syllabus.frames, syllabus.loops, syllabus.rate, holds=not recipe.as_recorded)
    if isinstance(plan, EchoStateRecipe):
        # Trials start at the first anchor, so more anchors would not change the choice.
        dense = msgspec.structs.replace(plan, anchor_every=1)
        network = (
            settled_echo_state(lessons, normalisation, dense, judge, seed)[0]
            if plan.choose_noise
            else train_echo_state(lessons, normalisation, dense, seed)
        )
        errors = [nrmse(network.recall(name), frames) for name, frames in syllabus.frames.items()]
        size = float(np.mean([mabs(network[name].readout) for name in network.motions]))
        return TrainingError(seed, size, float(np.mean(errors)), None, None, network)
    if isinstance(plan, RandomFeatureRecipe):
        network = train_random_features(lessons, normalisation, msgspec.structs.replace(plan, anchor_every=1), seed)
        errors = [nrmse(network.recall(name), frames) for name, frames in syllabus.frames.items()]
        size = mabs(network.reservoir.readout * normalisation.scaling)
        return TrainingError(seed, size, float(np.mean(errors)), None, None, network)
    if isinstance(plan, PhaseDrivenRecipe):
        network = train_phase_driven(lessons, normalisation, plan, syllabus.rate, seed)
        return _of_phase_driven(network, syllabus, plan.anchor_every, seed)
    if isinstance(plan, CentralizedRecipe):
        return _of_centralized(
            train_centralized_network(lessons, normalisation, plan, syllabus.rate, seed), syllabus, seed
        )
    loaded = load_reservoir(lessons, plan, seed)
    network, _ = settled_network(loaded, lessons, normalisation, plan, judge, seed)
    states, inputs = np.concatenate(loaded.states), np.concatenate([lesson.frames for lesson in lessons])
    readout, targets = loaded.readout, inputs
    if readout_targets is not None:
        targets = np.concatenate(readout_targets)
        readout = ridge(states, targets, plan.ridge)
    sized = error = None
    if plan.learns == "weights":
        before = np.concatenate(loaded.before)
        wanted = what_drove(loaded.reservoir, before, inputs)
        sized, error = mabs(loaded.weights), nrmse(before @ loaded.weights.T, wanted)
    return TrainingError(seed, mabs(readout), nrmse(states @ readout.T, targets), sized, error, network)


def _of_phase_driven(network: PhaseDriven, syllabus: TrainingSet, anchor_every: int, seed: int) -> TrainingError:
    """Errors of a phase-driven network at its anchors; a readout is taken as that of channels in [-1, 1]."""
    scaling = syllabus.normalised()[1].scaling[:, None]
    errors = [nrmse(network.recall(name), frames[::anchor_every]) for name, frames in syllabus.frames.items()]
    size = float(np.mean([mabs(network[name].readout[:, :, :-1] * scaling) for name in network.motions]))
    return TrainingError(seed, size, float(np.mean(errors)), None, None, network)


def _of_centralized(network: CentralizedNetwork, syllabus: TrainingSet, seed: int) -> TrainingError:
    """Errors of a centralized network, whose W is taken as that of channels brought to [-1, 1]."""
    scaling = syllabus.normalised()[1].scaling[:, None]
    parts = {name: network[name] for name in network.motions}
    errors = [
        nrmse(parts[name].at(np.arange(len(frames)) / syllabus.rate), frames)
        for name, frames in syllabus.frames.items()
    ]
    size = float(np.mean([mabs(part.matrix * scaling) for part in parts.values()]))
    return TrainingError(seed, size, float(np.mean(errors)), None, None, network)
