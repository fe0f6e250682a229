"""From a recipe to a motion library: prepare, train, test, and try the next seed if a motion fails."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from controller.learning.measures.disturbance import stress_test, with_trials
from controller.learning.measures.recording_errors import recorded_part, recording_error
from controller.learning.measures.self_test import Judge, MotionVerdict, self_test
from controller.learning.preparation.training_motion import Lessons
from controller.learning.recipe import LibraryRecipe, MotionRecipe, NetworkRecipe, recipe_of
from controller.learning.recording_analysis import find_skeleton
from controller.learning.trainers.trainer import kind_of, nrmse, trainer_of
from controller.learning.training_set import Progress, Recorded, TrainingSet, prepare, read_motion, to_learn
from controller.library.motion_library import VERSION, LibraryInfo, MotionInfo, MotionLibrary
from controller.motion.clip import AS_FOUND
from controller.motion.rotations import Array
from controller.motion.skeleton import Skeleton
from controller.networks.base import AnyNetwork
from controller.networks.storage import FEWEST_ANCHORS
from motiondeck_base.errors import FileFormatError, MotiondeckError


def fit(recipe: LibraryRecipe, data: Path, progress: Progress = lambda _: None) -> MotionLibrary:
    """Trains the library of a recipe from the recordings in a folder; MotiondeckError if one is missing or damaged.

    `progress` is called with each step; there are `steps(recipe)` of them without retries.
    """
    return fit_prepared(recipe, prepare(recipe, data, progress), progress)


def fit_prepared(
    recipe: LibraryRecipe, training_set: TrainingSet, progress: Progress = lambda _: None
) -> MotionLibrary:
    """Trains the library of a recipe whose recordings have been read, with `first_to_pass` of its seeds.

    FileFormatError if the recipe's anchors are too far apart for a motion.
    """
    for name, frames in training_set.frames.items():
        if len(frames[:: recipe.network.anchor_every]) < FEWEST_ANCHORS:
            raise FileFormatError(
                f"network.anchor_every = {recipe.network.anchor_every} leaves '{name}' with fewer than "
                f"{FEWEST_ANCHORS} states to start from; give a smaller number"
            )
    lessons, judge = training_set.lessons(), training_set.judge

    def train_with(seed: int) -> TrainedNetwork:
        progress(f"training (seed {seed})")
        trained = settle(sized, lessons, seed, judge)
        progress("self-test")
        return trained

    # Two BLAS threads on a busy machine wait for each other longer than they help.
    with threadpool_limits(1):
        sized = trainer_of(recipe.network).sized(recipe.network, lessons, recipe.seeds[0], judge, progress)
        trained = first_to_pass(recipe.seeds, train_with)
    recipe = msgspec.structs.replace(recipe, network=sized)
    return assemble(recipe, training_set, trained.network, trained.seed, trained.verdicts)


@dataclass(frozen=True)
class TrainedNetwork:
    """A network that was trained with a seed."""

    seed: int
    network: AnyNetwork
    verdicts: dict[str, MotionVerdict]  # of the self-test
    weights: NDArray[np.float32] | None = None  # W of a conceptor network, shape (N, N); a library keeps W U only
    asked: int = 0  # of several seeds the first that was tried

    @property
    def passed(self) -> int:
        """The number of motions that passed the self-test."""
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


def settle(recipe: NetworkRecipe, lessons: Lessons, seed: int, judge: Judge) -> TrainedNetwork:
    """The network of a recipe, tested; one that chooses gets the apertures or the noise that hold in trials."""
    trainer = trainer_of(recipe)
    settled = trainer.settle(recipe, lessons, seed, judge)
    verdicts: dict[str, MotionVerdict] = {}
    for motion in judge.loops:
        tested = self_test(settled.network, judge, (motion,))
        if settled.failed:
            tested = with_trials(tested, settled.failed)
        elif trainer.stress_tested:
            tested = stress_test(settled.network, tested, judge, seed)
        verdicts |= tested
        settled.network.rest()  # what plays is large beside what is stored
    return TrainedNetwork(seed, settled.network, verdicts, settled.weights)


def assemble(
    recipe: LibraryRecipe, training_set: TrainingSet, network: AnyNetwork, seed: int, verdicts: dict[str, MotionVerdict]
) -> MotionLibrary:
    """A library of a trained network and of all that is known about it."""
    frames, every = training_set.frames, recipe.network.anchor_every
    info = LibraryInfo(
        version=VERSION,
        name=recipe.name,
        network=kind_of(recipe.network),
        encoding=training_set.encoding.name,
        rate=training_set.rate,
        seed=seed,
        motions=[describe_motion(one, frames[one.name], network, verdicts[one.name], every) for one in recipe.motions],
        skeleton=training_set.encoding.skeleton_info(),
        recipe=msgspec.json.decode(msgspec.json.encode(recipe)),
        licence=recipe.licence,
        acknowledgement=recipe.acknowledgement,
        **network.header_fields(),
    )
    return judged(MotionLibrary(info, network, training_set.encoding), training_set.recorded)


def judged(library: MotionLibrary, recorded: Mapping[str, Recorded]) -> MotionLibrary:
    """The library with the errors of its motions against their recordings; too large ones fail a motion."""
    # A network that runs by itself keeps no time, so its motions have no such errors.
    if library.network.as_autonomous is not None:
        return library
    motions: list[MotionInfo] = []
    for motion in library.info.motions:
        if motion.name in recorded and (part := recorded[motion.name]()) is not None:
            error = recording_error(library, motion.name, part)
            passed, reason = motion.passed and not error.reason, motion.reason or error.reason
            found = {"against_recording": error, "body": part.body.info(), "passed": passed, "reason": reason}
            motion = msgspec.structs.replace(motion, **found)
        motions.append(motion)
        library.network.rest()
    return MotionLibrary(msgspec.structs.replace(library.info, motions=motions), library.network, library.encoding)


def steps(recipe: LibraryRecipe) -> int:
    """The steps of a fit when the first seed passes."""
    return len(recipe.motions) + 2


def describe_motion(
    motion: MotionRecipe, frames: Array, network: AnyNetwork, verdict: MotionVerdict, anchor_every: int
) -> MotionInfo:
    """The header of a motion that was learned from frames (T, C)."""
    recalled = network.recall(motion.name)
    network.rest()
    return MotionInfo(
        name=motion.name,
        plays=motion.plays,
        frames=len(frames),
        source=motion.file,
        nrmse=nrmse(recalled, frames[::anchor_every]),
        error_mm=verdict.error_mm,
        passed=verdict.passed,
        reason=verdict.reason,
        input=network.driving(motion.name),
    )


def judge_against(library: MotionLibrary, path: Path, file: Path) -> list[MotionInfo]:
    """The verdicts on the library's motions that were learned from a file of this name, by that file.

    `path` is for messages. MotiondeckError if no motion was learned from it alone, or it cannot be read or compared.
    """
    if not file.exists():
        raise MotiondeckError.missing(file, "file")
    recipe = recipe_of(library.info.recipe, path)
    plans = [one for one in recipe.motions if Path(one.file).name == file.name]
    if not plans:
        known = ", ".join(sorted({Path(one.file).name for one in recipe.motions}))
        raise MotiondeckError(f"{path}: no motion in it was learned from {file.name}; give one of {known}")
    return [_judge(library, path, file, recipe, plan) for plan in plans]


def _judge(library: MotionLibrary, path: Path, file: Path, recipe: LibraryRecipe, plan: MotionRecipe) -> MotionInfo:
    info = next(one for one in library.info.motions if one.name == plan.name)
    skeleton = find_skeleton(file, AS_FOUND)  # the file may lie elsewhere than when it was learned
    plan = msgspec.structs.replace(plan, file=str(file.absolute()), skeleton=skeleton and str(skeleton.absolute()))
    clip = read_motion(Path(), plan)
    if (known_part := info.against_recording) is not None:
        first, end = known_part.from_s, known_part.to_s
    else:
        part = to_learn(library.encoding, clip, plan, library.info.rate, recipe.loop_keeps)[1]
        first, end = part.first, part.end
    body = None if info.body is None else Skeleton.restore(info.body)
    recorded = recorded_part(clip, first, end, loop=info.plays == "loop", body=body)
    if recorded is None or plan.takes or recipe.as_recorded or library.network.as_autonomous is not None:
        raise MotiondeckError(f"{path}: motion '{info.name}' has no time or no body of one recording to compare with")
    # What the self-test said stays; what the recording said is said anew.
    reason = "" if known_part is not None and info.reason == known_part.reason else info.reason
    motions = [msgspec.structs.replace(info, passed=not reason, reason=reason)]
    alone = MotionLibrary(msgspec.structs.replace(library.info, motions=motions), library.network, library.encoding)
    return judged(alone, {info.name: lambda: recorded}).info.motions[0]
