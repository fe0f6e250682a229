"""From a recipe to a motion library: read, close the loops, train, test, and try the next seed if a motion fails."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from controller.library.library_header import FEWEST_ANCHORS, VERSION, LibraryInfo, MotionInfo, describe_skeleton
from controller.library.motion_library import MotionLibrary
from controller.library.network_arrays import AnyNetwork
from controller.measures.accuracy import nrmse
from controller.measures.motion_matching import joint_features
from controller.measures.self_test import Judge, MotionVerdict, self_test
from controller.measures.trials import with_trials
from controller.mocap.canonical.canonical_body import carried, to_canonical
from controller.mocap.canonical.clip_edits import mirrored, resampled, span
from controller.mocap.clip import Clip
from controller.mocap.encodings.encoding import Encoding, encoding_of
from controller.mocap.encodings.joint_angles import JointBody
from controller.mocap.encodings.normalisation import Normalisation
from controller.mocap.formats.reading import read_clip, skeleton_of
from controller.mocap.reading_options import ReadingOptions
from controller.mocap.skeleton import Skeleton
from controller.networks.centralized.centralized_frames import CentralizedNetwork
from controller.rotations import Array
from controller.training.centralized.centralized_training import CentralizedRecipe, train_centralized_network
from controller.training.preparation.loops import close_loop, hold_end
from controller.training.preparation.training_motion import TrainingMotion
from controller.training.recipe import CenterRecipe, LibraryRecipe, MotionRecipe, NetworkRecipe
from controller.training.reservoirs.aperture_choice import settled_network
from controller.training.reservoirs.conceptor_training import ConceptorRecipe, conceptor_network, load_reservoir
from controller.training.reservoirs.echo_state_training import EchoStateRecipe, train_echo_state
from controller.training.reservoirs.noise_choice import settled_echo_state
from controller.training.reservoirs.phase_training import PhaseRecipe, train_phase_conceptors
from controller.training.reservoirs.random_feature_training import RandomFeatureRecipe, train_random_features
from controller.training.stress_test import stress_test
from motiondeck_base.errors import FileFormatError

SHORTEST_SECONDS = 0.4  # of a recording: two windows of the self-test
COMMON_RATE = 120.0  # Hz, of a library whose recordings have different rates

Progress = Callable[[str], None]
Reader = Callable[[MotionRecipe], Clip]

_KINDS: dict[type, Literal["conceptor", "phase-conceptor", "echo-state", "random-feature", "centralized"]] = {
    ConceptorRecipe: "conceptor",
    PhaseRecipe: "phase-conceptor",
    EchoStateRecipe: "echo-state",
    RandomFeatureRecipe: "random-feature",
    CentralizedRecipe: "centralized",
}


@dataclass(frozen=True)
class TrainingSet:
    """The frames that a recipe wants learned.

    Attributes:
        encoding: of the channels.
        rate: frames per second.
        frames: what each motion is learned from, shape (T, channels), in the encoding's units.
        loops: whether it is a loop.
        before: what was recorded before those frames, of each motion, or nothing.
    """

    encoding: Encoding
    rate: float
    frames: dict[str, Array]
    loops: dict[str, bool]
    before: dict[str, Array]

    def normalised(self) -> tuple[list[TrainingMotion], Normalisation]:
        """What a trainer is given, and the normalisation of its channels."""
        normalisation = Normalisation.fit([*self.frames.values(), *self.before.values()])
        return [
            TrainingMotion(
                name,
                normalisation.apply(frames),
                self.loops[name],
                normalisation.apply(self.before[name]) if name in self.before else None,
            )
            for name, frames in self.frames.items()
        ], normalisation


def fit(
    recipe: LibraryRecipe, data: Path, progress: Progress = lambda _: None, read: Reader | None = None
) -> MotionLibrary:
    """Trains the library of a recipe from the recordings in a folder.

    Args:
        recipe: what to train.
        data: the folder that the recipe's files lie in.
        progress: called with each step in a few words; there are `steps(recipe)` of them without retries.
        read: gives the clip of a motion; None reads its file.

    Returns:
        The library of the first seed with which every motion passes the self-test; where none does, that of the seed
        with which most do.

    Raises:
        MotiondeckError: if a recording is missing or damaged.
    """
    training_set = prepare(recipe, data, progress, read)
    for name, frames in training_set.frames.items():
        if len(frames[:: recipe.network.anchor_every]) < FEWEST_ANCHORS:
            raise FileFormatError(
                f"network.anchor_every = {recipe.network.anchor_every} leaves '{name}' with fewer than "
                f"{FEWEST_ANCHORS} states to start from; give a smaller number"
            )
    motions, normalisation = training_set.normalised()
    judge = Judge(training_set.encoding, training_set.frames, training_set.loops, holds=not recipe.as_recorded)

    def train_with(seed: int) -> TrainedNetwork:
        progress(f"training (seed {seed})")
        trained = settle(motions, normalisation, recipe.network, training_set.rate, seed, judge)
        progress("self-test")
        return trained

    # Two BLAS threads on a busy machine wait for each other longer than they help.
    with threadpool_limits(1):
        trained = first_to_pass(recipe.seeds, train_with)
    return assemble(recipe, training_set, trained.network, trained.seed, trained.verdicts)


@dataclass(frozen=True)
class TrainedNetwork:
    """A trained network.

    Attributes:
        seed: it was drawn with.
        network: what plays.
        verdicts: of the self-test.
        weights: W of a conceptor network, shape (N, N).
    """

    seed: int
    network: AnyNetwork
    verdicts: dict[str, MotionVerdict]
    weights: NDArray[np.float32] | None = None

    @property
    def passed(self) -> int:
        """How many motions passed the self-test."""
        return sum(verdict.passed for verdict in self.verdicts.values())


def first_to_pass(seeds: Iterable[int], train_with: Callable[[int], TrainedNetwork]) -> TrainedNetwork:
    """The network of the first seed with which every motion passes; where none does, that with which most do."""
    best: TrainedNetwork | None = None
    for seed in seeds:
        trained = train_with(seed)
        if best is None or trained.passed > best.passed:
            best = trained
        if best.passed == len(best.verdicts):
            break
    assert best is not None, "a recipe names at least one seed"
    return best


def settle(
    motions: list[TrainingMotion],
    normalisation: Normalisation,
    recipe: NetworkRecipe,
    rate: float,
    seed: int,
    judge: Judge,
) -> TrainedNetwork:
    """The network of a recipe, tested; one that chooses gets the apertures or the noise that hold in trials."""
    weights, failed = None, {}
    if isinstance(recipe, ConceptorRecipe):
        loaded = load_reservoir(motions, recipe, seed)
        weights = loaded.weights.astype(np.float32)
        network, failed = settled_network(loaded, motions, normalisation, recipe, judge, seed)
    elif isinstance(recipe, EchoStateRecipe) and recipe.choose_noise:
        network, failed = settled_echo_state(motions, normalisation, recipe, judge, seed)
    else:
        network = train(motions, normalisation, recipe, rate, seed)
    verdicts = self_test(network, judge)
    if failed:
        verdicts = with_trials(verdicts, failed)
    elif not isinstance(network, CentralizedNetwork):
        # The state of a centralized network is a place on a closed curve; its centers return there by themselves.
        verdicts = stress_test(network, verdicts, judge, seed)
    return TrainedNetwork(seed, network, verdicts, weights)


def assemble(
    recipe: LibraryRecipe, training_set: TrainingSet, network: AnyNetwork, seed: int, verdicts: dict[str, MotionVerdict]
) -> MotionLibrary:
    """A library of a trained network and of all that is known about it."""
    info = LibraryInfo(
        version=VERSION,
        name=recipe.name,
        network=_KINDS[type(recipe.network)],
        encoding=training_set.encoding.name,
        rate=training_set.rate,
        seed=seed,
        motions=[
            describe_motion(
                motion, training_set.frames[motion.name], network, verdicts[motion.name], recipe.network.anchor_every
            )
            for motion in recipe.motions
        ],
        skeleton=describe_skeleton(training_set.encoding),
        recipe=msgspec.json.decode(msgspec.json.encode(recipe)),
        licence=recipe.licence,
        acknowledgement=recipe.acknowledgement,
        leak=recipe.network.leak if isinstance(recipe.network, EchoStateRecipe) else 1.0,
        clipped=recipe.network.clipped if isinstance(recipe.network, EchoStateRecipe) else True,
        scales=recipe.network.scales if isinstance(recipe.network, PhaseRecipe) else None,
    )
    return MotionLibrary(info, network, training_set.encoding)


def train(
    motions: list[TrainingMotion], normalisation: Normalisation, recipe: NetworkRecipe, rate: float, seed: int
) -> AnyNetwork:
    """The network that a recipe describes, untested."""
    if isinstance(recipe, CentralizedRecipe):
        return train_centralized_network(motions, normalisation, recipe, rate, seed)
    if isinstance(recipe, PhaseRecipe):
        return train_phase_conceptors(motions, normalisation, recipe, rate, seed)
    if isinstance(recipe, ConceptorRecipe):
        return conceptor_network(load_reservoir(motions, recipe, seed), motions, normalisation, recipe)
    if isinstance(recipe, RandomFeatureRecipe):
        return train_random_features(motions, normalisation, recipe, seed)
    return train_echo_state(motions, normalisation, recipe, seed)


def steps(recipe: LibraryRecipe) -> int:
    """How many steps a fit takes when the first seed passes."""
    return len(recipe.motions) + 2


def prepare(
    recipe: LibraryRecipe, data: Path, progress: Progress = lambda _: None, read: Reader | None = None
) -> TrainingSet:
    """Reads a recipe's recordings, carries them to one body and rate, and closes their loops or holds their ends.

    A recipe that wants them as recorded gets them so.

    Args:
        recipe: what to read.
        data: the folder that its files lie in.
        progress: called with each step in a few words.
        read: gives the clip of a motion; None reads its file.
    """
    clips: dict[str, Clip] = {}
    for motion in recipe.motions:
        progress(f"reading {motion.name}")
        clips[motion.name] = cut(read_motion(data, motion) if read is None else read(motion), motion)
    rates = sorted({clip.rate for clip in clips.values()})
    rate = recipe.rate or (rates[0] if len(rates) == 1 else COMMON_RATE)
    if recipe.as_recorded and rates != [rate]:
        raise FileFormatError(f"recipe '{recipe.name}' learns as recorded, but its recordings have {rates} Hz")
    twist = recipe.encoding == "joint rotations"
    encoding = encoding_of(_body(recipe, data, clips), twist=twist)
    frames: dict[str, Array] = {}
    before: dict[str, Array] = {}
    for motion in recipe.motions:
        clip = resampled(clips[motion.name], rate)
        if recipe.as_recorded and not isinstance(recipe.network, CenterRecipe):
            channels, washout = encoding_of(clip.skeleton, twist=twist).encode(clip), recipe.network.washout
            if len(channels) < 2 * washout:
                raise FileFormatError(f"motion '{motion.name}' is shorter than twice the washout of {washout} frames")
            before[motion.name], frames[motion.name] = channels[:washout], channels[washout:]
            continue
        frames[motion.name] = to_learn(encoding, clip, motion, recipe.loop_keeps)
    loops = {motion.name: motion.plays == "loop" for motion in recipe.motions}
    return TrainingSet(encoding, rate, frames, loops, before)


def read_motion(data: Path, motion: MotionRecipe) -> Clip:
    """The recording of a motion, all of its frames; left and right exchanged if it is to be mirrored."""
    path = find_recording(data, motion.file)
    skeleton = skeleton_of(path, data) if motion.skeleton is None else find_recording(data, motion.skeleton)
    clip = read_clip(path, ReadingOptions(skeleton))
    return mirrored(clip) if motion.mirrored else clip


def _body(recipe: LibraryRecipe, data: Path, clips: dict[str, Clip]) -> Skeleton:
    """The skeleton that a recipe's motions are carried to."""
    if recipe.body:
        path = find_recording(data, recipe.body)
        return read_clip(path, ReadingOptions(skeleton_of(path, data))).skeleton
    first = clips[recipe.motions[0].name]
    return first.skeleton if isinstance(first.skeleton, JointBody) else to_canonical(first).skeleton


def to_learn(encoding: Encoding, clip: Clip, motion: MotionRecipe, loop_keeps: float) -> Array:
    """The frames to learn of a clip, carried to the encoding's body: a closed loop, or a motion that holds its end."""
    channels = encoding.encode(carried(clip, encoding.skeleton))
    if motion.plays == "once":
        return hold_end(channels, encoding.velocities, clip.rate)
    return close_loop(channels, joint_features(encoding, channels), clip.rate, at_least=loop_keeps)


def find_recording(data: Path, file: str) -> Path:
    """A recording below the data folder, or directly in it.

    Raises:
        FileFormatError: if it is in neither.
    """
    for path in (data / file, data / Path(file).name):
        if path.exists():
            return path
    raise FileFormatError(f"{data / file}: there is no such file; --data is the folder that holds the recordings")


def cut(clip: Clip, motion: MotionRecipe) -> Clip:
    """The frames of a clip that a recipe wants.

    Raises:
        FileFormatError: if they are not in it, or too few.
    """
    first, end = motion.frames or (0, len(clip))
    if not 0 <= first < end <= len(clip):
        raise FileFormatError(f"motion '{motion.name}': frames {first} to {end} are not in a clip of {len(clip)}")
    shortest = int(np.ceil(SHORTEST_SECONDS * clip.rate))
    if end - first < shortest:
        raise FileFormatError(
            f"motion '{motion.name}': {end - first} frames are too few; {shortest} are the least at {clip.rate:g} Hz"
        )
    return span(clip, first, end)


def describe_motion(
    motion: MotionRecipe, frames: Array, network: AnyNetwork, verdict: MotionVerdict, anchor_every: int
) -> MotionInfo:
    """What a library knows of a motion that was learned from frames (T, C)."""
    return MotionInfo(
        name=motion.name,
        plays=motion.plays,
        frames=len(frames),
        source=motion.file,
        nrmse=nrmse(network.recall(motion.name), frames[::anchor_every]),
        error_mm=verdict.error_mm,
        passed=verdict.passed,
        reason=verdict.reason,
    )
