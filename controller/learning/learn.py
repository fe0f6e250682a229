"""Learns any recordings as one library, without a recipe.

Recordings are analysed (`recording_analysis`), resampled to one rate and carried to one body. The resulting recipe can
be edited and trained again.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, count
from pathlib import Path

import msgspec
from joblib import delayed

from controller.learning.fit import fit_prepared
from controller.learning.preparation.kind import LOOP_KEEPS
from controller.learning.preparation.takes import by_motion
from controller.learning.recipe import LibraryRecipe, NetworkRecipe, check_recipe, typeable
from controller.learning.recording_analysis import AnalysedRecording, Within, analyse_recording, numbered
from controller.learning.smallest import Candidate, smallest_network
from controller.learning.trainers.phase_conceptor import PhaseRecipe
from controller.learning.training_set import COMMON_RATE, LearnedPart, Progress, TrainingSet, prepare
from controller.library.motion_library import MotionInfo, MotionLibrary
from controller.motion.canonical.actors import hands_off
from controller.motion.clip import AS_FOUND, Clip, Decision, Plays, ReadingOptions
from controller.motion.formats.reading import recordings_in
from controller.motion.joint_tree import SeveralPeopleError
from controller.motion.upper_body import ACCEPTED
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.jobs import ALONE, Jobs, spread

# s, of a robot's motions: what a retargeter computed moves less smoothly than a human, by up to 7 degrees/frame^2.
_JOINTS_PIECE = 0.25


@dataclass(frozen=True)
class LearnedMotion:
    """The result for one recording; `name` of the file, and empty fields, if it was not learned."""

    name: str
    file: Path
    plays: str = ""  # "loop" or "once"
    seconds: float = 0.0  # duration of a round of the loop, or of the one-shot without the hold at its end
    part: LearnedPart | None = None  # the learned part of the recording, and the errors at its best seam
    info: MotionInfo | None = None  # in the library, with its errors
    passed: bool = False  # whether the motion may be played; if not, `remedy` says what helps
    remedy: str = ""
    doubts: list[str] = field(default_factory=list[str])  # warnings about the body
    decisions: list[Decision] = field(default_factory=list[Decision])


@dataclass(frozen=True)
class SharedBody:
    """What the body of a library costs one actor."""

    actor: str  # name of the skeleton
    motions: int
    hands_mm: float  # how far wrists are off in 95 % of the frames of the worst motion; 0 for the body's own actor


@dataclass(frozen=True)
class LearnedLibrary:
    """A library, its recipe, and the result for each recording."""

    library: MotionLibrary
    recipe: LibraryRecipe
    motions: list[LearnedMotion]
    actors: list[SharedBody] = field(default_factory=list[SharedBody])  # of bodies; that of the library first
    candidates: list[Candidate] = field(default_factory=list[Candidate])  # for a tolerance, the chosen one first

    @property
    def failed(self) -> list[LearnedMotion]:
        """The recordings that were not read, or failed the self-test."""
        return [motion for motion in self.motions if not motion.passed]


def learn(
    paths: Iterable[Path],
    name: str,
    *,
    options: ReadingOptions = AS_FOUND,
    within: Within = None,
    network: NetworkRecipe | None = None,
    seeds: Iterable[int] = (0, 1, 2),
    progress: Progress = lambda _: None,
    jobs: Jobs = ALONE,
    accept: Collection[str] | None = None,
    plays: Plays | None = None,
    whole: bool = False,
    tolerance_mm: float | None = None,
) -> LearnedLibrary:
    """Learns every recording of some files and folders as one library; unusable ones are listed with the reason.

    A long recording of several behaviours is several motions, with numbers behind its name.

    Args:
        options: override all files.
        within: part of each to use.
        network: its kind and sizes; None is the default of a recipe.
        seeds: tried until every motion passes the self-test.
        progress: called with each step.
        accept: motions, or "all", that are learned in spite of doubts about their anatomy; None is "all". With
            "upper-body" recordings without legs get some that rest.
        plays: how all of them play; None decides for each.
        whole: each recording is one motion.
        tolerance_mm: takes the smallest network of which no motion's mean error is larger, in place of `network`.
        jobs: where recordings are read; the network is trained here.

    Raises:
        MotiondeckError: if no recording can be used, or bodies and rigs are mixed.
    """
    options = replace(options, upper_body=options.upper_body or ACCEPTED in (accept or ()))
    takes = _takes(recordings_in(paths, convertible=True))
    files = list(takes)
    names = _names(files)
    examined: list[AnalysedRecording] = []
    left_out: list[LearnedMotion] = []
    tasks = (delayed(_examined)(file, names[file], options, takes[file], within, plays, whole) for file in files)
    results = spread(tasks, jobs)
    for file in files:
        progress(f"reading {file.name}")
        for one in next(results):
            if isinstance(one, LearnedMotion):
                left_out.append(one)
            elif accept is not None and one.take.anatomy and not {one.name, "all"} & set(accept):
                left_out += [] if one.name in {other.name for other in left_out} else [_doubted(one)]
            else:
                examined.append(one)
    examined = _unlike(examined)
    if not examined:
        none = f"none of {len(files)} recordings can be learned. " if len(files) > 1 else ""
        first = left_out[0]
        file = "" if first.remedy.startswith(f"{first.file} ") else f"{first.file}: "
        raise MotiondeckError(f"{none}{file}{first.remedy}")
    kinds = {one.clip.skeleton.is_rig for one in examined}
    if len(kinds) > 1:
        raise MotiondeckError("recordings of bodies and of a robot's joints do not share a library; learn them apart")
    network = network or (PhaseRecipe(piece_seconds=_JOINTS_PIECE) if kinds == {True} else PhaseRecipe())
    rate = None if any(file.suffix.lower() == ".clip" for file in files) else COMMON_RATE
    motions = [one.motion for one in examined]
    recipe = LibraryRecipe(
        name=name, network=network, motions=motions, rate=rate, loop_keeps=LOOP_KEEPS, seeds=list(seeds)
    )
    check_recipe(recipe, Path(name))
    clips = {one.motion.name: one.clip for one in examined}
    training_set = prepare(recipe, Path(), progress, lambda motion: clips[motion.name])
    candidates: list[Candidate] = []
    if tolerance_mm is not None:
        candidates = smallest_network(tolerance_mm, training_set, recipe.seeds[0], progress)
        recipe = msgspec.structs.replace(recipe, network=candidates[0].recipe)
    library = fit_prepared(recipe, training_set, progress)
    rows = [_row(one, training_set, library) for one in examined]
    return LearnedLibrary(library, recipe, [*rows, *left_out], _shared_body(training_set, clips), candidates)


def _shared_body(training_set: TrainingSet, clips: dict[str, Clip]) -> list[SharedBody]:
    body = training_set.encoding.skeleton
    found: list[SharedBody] = []
    for actor in training_set.actors:
        # Several motions may be of one recording.
        recorded = {id(clip): clip for clip in (clips[name] for name in actor.motions)}.values()
        off = 0.0 if actor.body is body else max(hands_off(clip, body) for clip in recorded)
        found.append(SharedBody(actor.name, len(actor.motions), off))
    return sorted(found, key=lambda one: one.hands_mm)


def _doubted(one: AnalysedRecording) -> LearnedMotion:
    take, file = one.take, Path(one.motion.file)
    remedy = f"{' '.join(take.anatomy)} If that is right: --accept {one.name}"
    return LearnedMotion(one.name, file, remedy=remedy, doubts=take.doubts, decisions=take.decisions)


def _row(one: AnalysedRecording, training_set: TrainingSet, library: MotionLibrary) -> LearnedMotion:
    info = next(info for info in library.info.motions if info.name == one.motion.name)
    part = training_set.parts[info.name]
    if part.seam_mm is None:
        part = replace(part, seam_mm=one.take.seam_mm, seam_degrees=one.take.seam_degrees)
    return LearnedMotion(
        name=info.name,
        file=Path(one.motion.file),
        plays=info.plays,
        seconds=part.end - part.first,
        part=part,
        info=info,
        passed=info.passed,
        remedy="" if info.passed else f"{info.reason}. {_remedy(one, info)}",
        doubts=one.take.doubts,
        decisions=one.take.decisions,
    )


def _remedy(one: AnalysedRecording, info: MotionInfo) -> str:
    if info.against_recording is not None and info.reason == info.against_recording.reason:
        return "Give it frames without that moment in the recipe, and learn the recipe."
    if one.motion.plays == "loop":
        return "Set plays = 'once' in the recipe, or frames to some whole cycles, and learn the recipe."
    return "Give it frames without pauses, more neurons or a shorter piece_seconds in the recipe, and learn the recipe."


def _takes(files: list[Path]) -> dict[Path, list[Path]]:
    """The recordings to learn, each with further takes of a motion taught to a rig."""
    groups = by_motion(file for file in files if file.suffix.lower() == ".clip")
    further = {takes[0]: takes[1:] for takes in groups}
    taken = {take for takes in further.values() for take in takes}
    return {file: further.get(file, []) for file in files if file not in taken}


def _examined(
    file: Path, name: str, options: ReadingOptions, takes: list[Path], within: Within, plays: Plays | None, whole: bool
) -> Sequence[AnalysedRecording | LearnedMotion]:
    """What is to be learned of a file, of each of several people in it; or why not."""
    try:
        return analyse_recording(file, name, options, within, takes, plays, whole=whole)
    except SeveralPeopleError as error:
        names = list(error.people)  # outlives the error, whose traceback holds what was read
    except MotiondeckError as error:
        return [LearnedMotion(name, file, remedy=str(error).removeprefix(f"{file}: "))]
    people = [(typeable(f"{name}-{person}"), replace(options, person=person)) for person in names]
    return [one for name, own in people for one in _examined(file, name, own, takes, within, plays, whole)]


def _unlike(examined: list[AnalysedRecording]) -> list[AnalysedRecording]:
    """Motions with other numbers where a motion has the name of another recording."""
    taken = {one.name for one in examined}
    found: list[AnalysedRecording] = []
    for one in examined:
        name = one.motion.name
        if name != one.name:
            name = _free(name, name, taken)
        found.append(replace(one, motion=msgspec.structs.replace(one.motion, name=name)))
    return found


def _names(files: list[Path]) -> dict[Path, str]:
    """A name for each file that can be typed: its stem, with its folder or a number if stems are equal."""
    plain = {file: typeable(file.stem) for file in files}
    shared = Counter(plain.values())
    names: dict[Path, str] = {}
    taken: set[str] = set()
    for file in files:
        name = plain[file] if shared[plain[file]] == 1 else typeable(f"{file.parent.name}-{file.stem}")
        names[file] = _free(name, plain[file], taken)
    return names


def _free(name: str, plain: str, taken: set[str]) -> str:
    """The name, or if it is taken the plain one with a number; then that is taken."""
    free = next(one for one in chain([name], map(partial(numbered, plain), count(2))) if one not in taken)
    taken.add(free)
    return free
