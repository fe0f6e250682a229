"""Adds one motion to a library that has been trained, and leaves what is stored as it is.

The new motion is learned from its clip alone: a conceptor network loads it into what is left of its reservoir
(`incremental_loading.py`), an echo-state network gets one more readout, a centralized one one more motion. It then
has to pass the self-test beside the stored ones, which are known by what they play.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from threadpoolctl import threadpool_limits

from controller.learning.centralized.centralized_training import CentralizedRecipe, train_centralized_network
from controller.learning.fit import describe_motion
from controller.learning.measures.self_test import Judge, MotionVerdict, run_free, self_test
from controller.learning.preparation.training_motion import TrainingMotion
from controller.learning.recipe import LibraryRecipe, MotionRecipe, check_name, recipe_of
from controller.learning.reservoirs.conceptor_training import ConceptorRecipe
from controller.learning.reservoirs.echo_state_training import EchoStateRecipe, learn_readouts
from controller.learning.reservoirs.incremental_loading import load_one_more, memory_of, quota
from controller.learning.reservoirs.phase_training import PhaseDrivenRecipe
from controller.learning.reservoirs.rank_choice import cut_to_tolerance
from controller.learning.stress_test import stress_test
from controller.learning.training_set import LearnedPart, to_learn
from controller.library.motion_library import MotionLibrary
from controller.library.network_arrays import AnyNetwork
from controller.motion.canonical.clip_edits import mirrored
from controller.motion.clip import Clip
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array
from controller.networks.centralized.centralized_frames import CentralizedNetwork
from controller.networks.reservoirs.conceptor import ConceptorNetwork
from controller.networks.reservoirs.echo_state import EchoStateNetwork
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork
from controller.networks.reservoirs.random_feature_conceptor import RandomFeatureNetwork
from controller.networks.reservoirs.reservoir import Reservoir
from motiondeck_base.errors import MotiondeckError

FARTHEST = 50.0  # half ranges of a channel in the stored motions: beyond it no reservoir can follow
STILL = 1e-3  # m, m/s, rad, or of a direction: what moves less stands still


@dataclass(frozen=True)
class Addition:
    """A library with one motion more.

    Attributes:
        library: with the new motion as its last.
        verdict: of the self-test on it.
        part: which part of the recording it was learned from.
        quota_before, quota: the share of the reservoir's space that the stored motions claim, without it and with it;
            None for networks that have no space to share.
    """

    library: MotionLibrary
    verdict: MotionVerdict
    part: LearnedPart
    quota_before: float | None
    quota: float | None


def add_motion(library: MotionLibrary, path: Path, clip: Clip, motion: MotionRecipe) -> Addition:
    """Learns a clip as one more motion of a library.

    Args:
        library: as it was trained or added to.
        path: of the library, for error messages.
        clip: the recording, of any skeleton and rate.
        motion: what it is called, how it plays and which of its frames to take.

    Raises:
        MotiondeckError: if the name is taken or cannot be typed, the clip does not fit, or the network cannot be added
            to.
    """
    info, network = library.info, library.network
    recipe = recipe_of(info.recipe, path)
    check_name(motion.name, path)
    if motion.name in network.motions:
        raise MotiondeckError(f"{path}: there is a motion '{motion.name}' in it already; give another --name")
    if recipe.as_recorded:
        raise MotiondeckError(
            f"{path}: its motions were learned as recorded, without loops; such a library is not added to"
        )
    own = mirrored(clip) if motion.mirrored else clip
    frames, part = to_learn(library.encoding, own, motion, info.rate, recipe.loop_keeps)
    lengths = {known.name: known.frames for known in info.motions}
    with threadpool_limits(1):
        grown, claimed = _learn(library, recipe, lengths, motion, frames)
        loops = {known.name: known.plays == "loop" for known in info.motions} | {motion.name: motion.plays == "loop"}
        played = {name: run_free(network.twin(), name, length) for name, length in lengths.items()}
        judge = Judge(library.encoding, played | {motion.name: frames}, loops, info.rate)
        verdict = self_test(grown, judge, (motion.name,))
        if not isinstance(grown, CentralizedNetwork):
            verdict = stress_test(grown, verdict, judge, info.seed)
    new = describe_motion(motion, frames, grown, verdict[motion.name], recipe.network.anchor_every)
    longer = msgspec.structs.replace(recipe, motions=[*recipe.motions, motion])
    header = msgspec.structs.replace(
        info,
        motions=[*info.motions, new],
        recipe=msgspec.json.decode(msgspec.json.encode(longer)),
        acknowledgement=f"{info.acknowledgement} '{motion.name}' was added from {Path(motion.file).name}.".strip(),
    )
    return Addition(MotionLibrary(header, grown, library.encoding), verdict[motion.name], part, *claimed)


def _scaled(normalisation: Normalisation, frames: Array, library: str) -> Array:
    """The frames as the stored motions are scaled.

    Raises:
        MotiondeckError: if the motion moves what stands still in all stored ones, and so has no scale.
    """
    scaled = normalisation.apply(frames)
    unscaled = np.abs(frames + normalisation.shift)[:, normalisation.scaling == 0.0]
    if np.abs(scaled).max() > FARTHEST or (unscaled > STILL).any():
        raise MotiondeckError(
            f"the motion moves parts that stand still in all motions of the library '{library}'. "
            "Train all of them together, with fit or learn."
        )
    return scaled


def _learn(
    library: MotionLibrary,
    recipe: LibraryRecipe,
    lengths: dict[str, int],
    motion: MotionRecipe,
    frames: Array,
) -> tuple[AnyNetwork, tuple[float | None, float | None]]:
    """The network with one more motion, and what of its space is claimed before and after."""
    network, seed, plan, loop = library.network, library.info.seed, recipe.network, motion.plays == "loop"
    if isinstance(network, ConceptorNetwork) and isinstance(plan, ConceptorRecipe):
        to_load = TrainingMotion(motion.name, _scaled(memory_of(network).normalisation, frames, recipe.name), loop)
        grown = load_one_more(network, lengths, to_load, plan, seed)
        if plan.rank_tolerance_mm is not None:
            # The stored motions were cut when they were learned.
            grown = cut_to_tolerance(grown, library.encoding, plan.rank_tolerance_mm, (motion.name,))
        return grown, (quota(network, lengths, plan), quota(grown, lengths | {motion.name: len(frames)}, plan))
    if isinstance(plan, PhaseDrivenRecipe) and isinstance(network, PhaseDrivenNetwork) and type(network) is plan.plays:
        one = TrainingMotion(motion.name, _scaled(network.normalisation, frames, recipe.name), loop)
        part = plan.learn(one, network.reservoir, network.normalisation, library.info.rate)
        return network.with_motions({motion.name: part}), (None, None)
    if isinstance(network, EchoStateNetwork) and isinstance(plan, EchoStateRecipe):
        to_load = TrainingMotion(motion.name, _scaled(network.normalisation, frames, recipe.name), loop)
        reservoir = Reservoir(network.weights, network.feedback, network.bias, network.leak)
        # Noise of its own, the same whenever this motion is added in this place.
        part = learn_readouts(reservoir, [to_load], plan, np.random.default_rng([seed, len(lengths)]))
        return network.with_motions(part), (None, None)
    if isinstance(network, CentralizedNetwork) and isinstance(plan, CentralizedRecipe):
        normalisation = Normalisation.fit([frames])
        to_load = TrainingMotion(motion.name, normalisation.apply(frames), loop)
        return network.joined(train_centralized_network([to_load], normalisation, plan, library.info.rate, seed)), (
            None,
            None,
        )
    if isinstance(network, RandomFeatureNetwork):
        raise MotiondeckError(
            f"library '{recipe.name}' holds random feature conceptors, which learn all motions at once; "
            "name the clip in their recipe and train it again with fit"
        )
    raise MotiondeckError(f"the recipe in the library '{recipe.name}' is for another kind of network")
