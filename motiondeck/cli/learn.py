"""`motiondeck learn`: a library of recordings, or of a recipe."""

from __future__ import annotations

import os
import re
import sys
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
from typer import Argument, Option

from motiondeck.cli.common import options as shared
from motiondeck.cli.common.options import JsonOption, Reading
from motiondeck_base.arrays_on_disk import return_freed_arrays
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import check_folder, write_file
from motiondeck_base.progress import progress

if TYPE_CHECKING:
    from controller.learning.recipe import LibraryRecipe
    from controller.motion.clip import ReadingOptions
    from motiondeck_base.jobs import Jobs
    from sim.physical.files import StoodFile


@dataclass(frozen=True)
class LearnOptions:
    """Options of `learn` apart from those of reading."""

    what: Annotated[
        list[Path], Argument(metavar="RECORDING...|RECIPE", help="Recordings, folders of them, or a recipe (.toml).")
    ]
    out: Annotated[
        Path | None, Option(metavar="FILE", help="The library (.safetensors); default: mine, or the recipe's name.")
    ] = None
    force: Annotated[bool, Option("--force", help="Replace the library and the recipe if they exist.")] = False
    data: Annotated[Path | None, Option(metavar="DIR", help="The recordings; default: the recipe's folder.")] = None
    allow_failing: Annotated[
        bool, Option("--allow-failing", help="Write a recipe's library even if a motion fails its self-test.")
    ] = False
    play: Annotated[bool, Option("--play", help="Play the first motion afterwards.")] = False
    robot: Annotated[
        str | None, Option(metavar="ROBOT", help="Say which motions this robot plays; --play plays them on it.")
    ] = None
    physical: Annotated[
        bool, Option("--physical", help="Learn what --robot does on its own feet, as `retarget --physical` finds it.")
    ] = False
    jobs: shared.JobsOption = "1"
    ground: shared.GroundOption = "auto"
    accept: Annotated[
        list[str] | None,
        Option(metavar="NAME", help="Learn a recording in spite of doubts about it; all; or upper-body: without legs."),
    ] = None
    plays: Annotated[
        Literal["loop", "once"] | None, Option("--as", help="How recordings play; default: as each motion suggests.")
    ] = None
    whole: Annotated[bool, Option("--whole", help="Learn each recording as one motion, however long.")] = False
    tolerance: Annotated[
        float | None, Option(metavar="MM", min=0.01, help="Take the smallest network with at most this mean error.")
    ] = None


@shared.grouped
def learn(options: LearnOptions, reading: Reading, as_json: JsonOption = False) -> None:
    """Learn a library from recordings, or from a recipe.

    Recordings need no settings. One of 12 s and more is cut into motions where the behaviour changes or the body rests
    (--whole overrules). Still ends are trimmed. A motion that returns, and is repeated or moves on there, becomes a
    loop; any other plays once and ends in its last pose (--as overrules). Every motion is tested. What is left out is
    printed with the reason, as are doubts about a body. The recipe is written beside the library (NAME.toml, or
    NAME.recipe.toml where that is a rig file or keyframes): edit it, and learn that. With --robot the table of
    `preflight` follows: which motions that robot plays, and at which tempo.

    With --physical the joint angles of --robot are learned, as its simulation does each motion on its own feet, from
    files in a folder NAME beside the library, each whole and once. Motions in which it falls are left out. It takes
    15 to 20 s of processor time a second of motion (G1). That robot and rigs with its joints play them in place, and
    with --root free on its feet, by the feedback in the folder.

    Clips of `motiondeck rig teach` and keyframes (.toml) play once or as loops, as they were taught or written.
    NAME.clip, NAME.2.clip ... are takes of one motion and are averaged. The part of a loop that returns best to its
    start is learned.

    With --tolerance the smallest kind of network is taken, also in place of a recipe's, of which no motion is farther
    off than MM. What else was tried is printed, and the bytes and the error of a clip of splines.

    A recipe (.toml) is learned as it says. Its library is written if every motion passes: each runs free for three
    times its length, and is compared with all that was trained (the self-test) and with its recording as it was read.
    `motiondeck examples DIR` copies configs/ and walk.bvh.

    [bold]Examples[/]

      motiondeck learn walk.bvh dance.c3d --play
      motiondeck learn recordings --out mine.safetensors --play --robot servo20
      motiondeck learn bow.bvh --out bow.safetensors --robot g1.toml --physical
      motiondeck learn mine.toml --force
      motiondeck learn configs/libraries/thesis15.toml --data recordings --out my.safetensors
      motiondeck learn wave.clip nod.clip wink.toml --out gestures.safetensors
    """
    from controller.learning.recipe import gesture_recipe, read_recipe
    from motiondeck_base.jobs import Jobs
    from sim.robots.catalogue import find_robot

    jobs, own = Jobs.parse(options.jobs), replace(reading.options(), ground=shared.ground_of(options.ground))
    if options.robot is not None:
        find_robot(options.robot)  # a misspelt name is refused before anything is learned
    if options.out is not None:
        shared.check_ending(options.out, "a library")
    kinds = {_kind(path) for path in options.what}
    if reading != Reading() and "recording" not in kinds:
        raise MotiondeckError("--unit and other options of reading are for recordings; in a recipe they are keys")
    if options.plays is not None and kinds != {"recording"}:
        raise MotiondeckError("--as is for recordings; a recipe and keyframes have plays, and clips are taught with it")
    if options.whole and kinds != {"recording"}:
        raise MotiondeckError("--whole is for recordings; a recipe says by frames what it takes of one")
    if options.physical and (options.robot is None or kinds != {"recording"}):
        raise MotiondeckError("--physical is for recordings on the feet of a --robot")
    if options.tolerance is not None and kinds == {"gesture"}:
        raise MotiondeckError("--tolerance is in mm, for bodies; clips and keyframes are of joints")
    if "recipe" not in kinds and options.data is not None:
        raise MotiondeckError(f"--data {options.data} is the folder of a recipe's recordings; no recipe is given")
    if "recipe" in kinds:
        if len(options.what) > 1:
            raise MotiondeckError(f"give one recipe alone, or recordings, not {', '.join(map(str, options.what))}")
        file = options.what[0]
        folder = file.parent if options.data is None else options.data
        if not folder.is_dir():
            raise MotiondeckError(f"{folder}: there is no such folder; --data is the folder that holds the recordings")
        recipe = read_recipe(file, folder)
        out = _library(options, recipe.name)
        first = _learn_recipe(recipe, folder, file, out, options, as_json, taught=False)
    elif kinds == {"gesture"}:
        out = _library(options, "gestures", and_recipe=True)
        recipe = gesture_recipe(out.stem, [path.absolute() for path in options.what])
        first = _learn_recipe(recipe, Path(), _recipe_beside(out), out, options, as_json, taught=True)
    else:
        out = _library(options, "mine", and_recipe=True)
        first = _learn_recordings(options, out, own, jobs, as_json)
    if options.play:
        command = [sys.executable, "-P", "-m", "motiondeck", "play", first, "--library", str(out.absolute())]
        os.execv(sys.executable, [*command, *([] if options.robot is None else ["--robot", options.robot])])


def _kind(path: Path) -> Literal["recipe", "gesture", "recording"]:
    """What a file to learn is; a gesture of a rig's joints was taught or written as keyframes."""
    from controller.motion.formats.keyframes import is_keyframes

    if path.suffix.lower() == ".toml" and not is_keyframes(path):
        return "recipe"
    return "gesture" if path.suffix.lower() in (".clip", ".toml") else "recording"


_OF_JOINTS = re.compile(rb"^\s*(\[\[\s*(key|joints)\b|(key|joints)\s*=)", re.MULTILINE)


def _recipe_beside(out: Path) -> Path:
    """The recipe of a library: NAME.toml, or NAME.recipe.toml where that is a rig file or keyframes."""
    recipe = out.with_suffix(".toml")
    try:
        return out.with_suffix(".recipe.toml") if _OF_JOINTS.search(recipe.read_bytes()) else recipe
    except OSError:
        return recipe


def _library(options: LearnOptions, name: str, *, and_recipe: bool = False) -> Path:
    """The library to write, after a check that neither it nor the recipe to write exists."""
    out = options.out or Path(f"{name}.safetensors")
    check_folder(out)
    recipe = _recipe_beside(out)
    edited = f". A recipe that you have edited is trained with: motiondeck learn {recipe}" if and_recipe else ""
    found = [out.with_suffix("")] if options.physical else []
    shared.check_new(*([recipe] if and_recipe else []), out, *found, force=options.force, hint=edited)
    return out


def _learn_recordings(options: LearnOptions, out: Path, reading: ReadingOptions, jobs: Jobs, as_json: bool) -> str:
    from controller.learning import learn as learning
    from controller.learning.recipe import recipe_text
    from controller.library.motion_library import save_library
    from controller.motion.clip import AS_FOUND
    from controller.motion.formats.reading import recordings_in
    from motiondeck.cli.common.verdict_report import verdicts_on
    from motiondeck.cli.learn_report import report_recordings
    from motiondeck.cli.robot.retarget import stand
    from sim.robots.catalogue import find_robot

    files, folder = recordings_in(options.what, convertible=True), out.with_suffix("")
    stood: list[StoodFile] = []
    if options.physical:
        stood = stand(files, find_robot(str(options.robot)), folder, options=reading, feedback=True)
        files, reading = [folder / str(row.file) for row in stood if row.stands], AS_FOUND
        if not files:
            first = stood[0]
            why = first.error or f"in {first.recording} it falls at {first.fell_s:.2f} s; {folder} has what it does"
            raise MotiondeckError(f"{options.robot} does none of these motions to the end on its feet: {why}")
    return_freed_arrays()
    with progress("", 2 * len(files) + 2) as tick:  # more where one holds more motions
        learned = learning.learn(
            files,
            out.stem,
            options=reading,
            progress=tick,
            jobs=jobs,
            accept=options.accept or [],
            plays=options.plays or ("once" if options.physical else None),
            whole=options.whole or options.physical,
            tolerance_mm=options.tolerance,
        )
    save_library(learned.library, out)
    recipe = _recipe_beside(out)
    write_file(recipe, recipe_text(learned.recipe, recipe.parent).encode())
    judge = partial(verdicts_on, options.robot, out, list(learned.library.network.motions))
    report_recordings(learned, out, recipe, judge, as_json, stood)
    return next((motion.name for motion in learned.motions if motion.passed), learned.motions[0].name)


def _learn_recipe(
    recipe: LibraryRecipe, folder: Path, file: Path, out: Path, options: LearnOptions, as_json: bool, *, taught: bool
) -> str:
    """Trains a recipe, writes the library (and the recipe of taught clips), and reports; returns the first motion."""
    from controller.learning import fit as training
    from controller.learning.recipe import recipe_text, warnings
    from controller.learning.smallest import Candidate, smallest_network
    from controller.learning.training_set import prepare
    from controller.library.motion_library import save_library
    from motiondeck.cli.common.verdict_report import verdicts_on
    from motiondeck.cli.learn_report import report_recipe

    for warning in warnings(recipe):
        print(f"motiondeck: warning: {file}: {warning}", file=sys.stderr)
    with progress("", training.steps(recipe)) as tick:
        training_set = prepare(recipe, folder, tick)
        candidates: list[Candidate] = []
        if options.tolerance is not None:
            if recipe.as_recorded:
                raise MotiondeckError(f"{file}: --tolerance needs closed loops, and the recipe has as_recorded")
            candidates = smallest_network(options.tolerance, training_set, recipe.seeds[0], tick)
            recipe = msgspec.structs.replace(recipe, network=candidates[0].recipe)
        library = training.fit_prepared(recipe, training_set, tick)
    failing = [motion.name for motion in library.info.motions if not motion.passed]
    written = not failing or options.allow_failing
    if written:
        save_library(library, out)
    if taught:
        write_file(file, recipe_text(recipe, file.parent).encode())
    judge = partial(verdicts_on, options.robot if written else None, out, list(library.network.motions))
    report_recipe(
        library, recipe, training_set, out if written else None, file if taught else None, judge, candidates, as_json
    )
    if not written:
        raise MotiondeckError(
            f"{', '.join(failing)} failed the self-test, so {out} was not written. "
            "Give the recipe more seeds, or write it anyway with --allow-failing."
        )
    return library.info.motions[0].name
