"""`motiondeck learn`: a library of any recordings, in one command."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motiondeck.cli.common.options import (
    JobsOption,
    JsonOption,
    RenameOption,
    SkeletonOption,
    UnitOption,
    UpOption,
    check_ending,
    check_new,
    reading_options,
)
from motiondeck_base.counted import counted
from motiondeck_base.files import check_folder

if TYPE_CHECKING:
    from controller.learning.learn import LearnedLibrary


def learn(
    recordings: Annotated[
        list[Path],
        typer.Argument(metavar="FILE_OR_FOLDER...", help="Recordings in any format, and folders that hold some."),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="FILE",
            help="The library to write (.safetensors); its recipe is written beside it (.toml).",
        ),
    ] = Path("mine.safetensors"),
    force: Annotated[bool, typer.Option("--force", help="Replace the library and the recipe if they exist.")] = False,
    play: Annotated[bool, typer.Option("--play", help="Play the first motion afterwards.")] = False,
    robot: Annotated[
        str | None, typer.Option("--robot", metavar="ROBOT", help="The robot that plays: a robot file or name.")
    ] = None,
    skeleton: SkeletonOption = None,
    unit: UnitOption = None,
    up: UpOption = None,
    rename: RenameOption = None,
    jobs: JobsOption = "1",
    as_json: JsonOption = False,
) -> None:
    """Learn a library from recordings: nothing to choose, no recipe to write.

    Still ends are trimmed; a recording whose best seam is close becomes a loop, any other a one-shot that ends in a
    pose; all are resampled to 120 Hz and carried to one body. Every motion is then tested. Recordings that cannot be
    read are left out, with the reason; what looks wrong about a body is printed as a doubt. --unit, --up, --rename and
    --skeleton overrule what was detected, for all given recordings. --jobs shares the reading of recordings.

    [bold]Examples[/]

      motiondeck learn walk.bvh dance.c3d --play
      motiondeck learn recordings --out mine.safetensors --play --robot servo20
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from controller.deck.worst_join import worst_join
    from controller.learning import learn as learning
    from controller.learning.recipe import warnings
    from controller.learning.recipe_text import recipe_text
    from controller.library.motion_library import save_library
    from motiondeck.cli.common.library_report import join_fields, join_line
    from motiondeck_base.errors import MotiondeckError
    from motiondeck_base.files import write_file
    from motiondeck_base.jobs import Jobs

    check_ending(out, "a library")
    check_folder(out)
    recipe = out.with_suffix(".toml")
    where = Jobs.parse(jobs)
    if robot is not None and not play:
        raise MotiondeckError("--robot names who plays: give --play too")
    trained = f". A recipe that you have edited is trained with: motiondeck fit {recipe}"
    check_new(recipe, out, force=force, hint=trained)
    options = reading_options(skeleton, unit, up, rename)
    console = Console(stderr=True)
    columns = (TextColumn("{task.description:44}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, disable=not sys.stderr.isatty(), transient=True) as bar:
        total = 2 * len(learning.recordings_in(recordings)) + 2
        task = bar.add_task("", total=total)

        def progress(step: str) -> None:
            bar.update(task, advance=1, description=step)

        learned = learning.learn(recordings, out.stem, options=options, progress=progress, jobs=where)
    save_library(learned.library, out)
    worst = worst_join(learned.library)
    write_file(recipe, recipe_text(learned.recipe).encode())
    if as_json:
        told = {"motions": _rows(learned), "warnings": warnings(learned.recipe)}
        print(json.dumps({"written": str(out), "recipe": str(recipe)} | told | {"worst_join": join_fields(worst)}))
    else:
        _print(learned)
        if worst is not None:
            print(join_line(worst))
        for warning in warnings(learned.recipe):
            print(f"warning: {warning} {recipe}")
        print(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB) and its recipe {recipe}")
    if play:
        first = next((motion.name for motion in learned.motions if motion.passed), learned.motions[0].name)
        command = [sys.executable, "-P", "-m", "motiondeck", "play", first, "--library", str(out.absolute())]
        os.execv(sys.executable, [*command, *([] if robot is None else ["--robot", robot])])


def _rows(learned: LearnedLibrary) -> list[dict[str, Any]]:
    """One entry a recording; what is not known of one that was left out is null."""
    from motiondeck.cli.common.library_report import part_fields

    rows: list[dict[str, Any]] = []
    for motion in learned.motions:
        part = motion.part
        rows.append(
            {
                "name": motion.name,
                "file": str(motion.file),
                "plays": motion.plays or None,
                "seconds": motion.seconds if part else None,
                **part_fields(part),
                "error_mm": motion.error_mm if part else None,
                "passed": motion.passed,
                "remedy": motion.remedy,
                "doubts": motion.doubts,
            }
        )
    return rows


def _print(learned: LearnedLibrary) -> None:
    """One row a recording, then what to do about those that failed, and what is doubtful."""
    from motiondeck.cli.common.library_report import part_of, seam_of
    from motiondeck.cli.common.tables import show_table

    rows: list[tuple[str, ...]] = []
    for motion in learned.motions:
        verdict = "[green]passed[/]" if motion.passed else "[red]failed[/]" if motion.plays else "[red]left out[/]"
        figures = ("", "", "", "", "")
        if motion.part is not None:
            seconds, error = f"{motion.seconds:.2f}", f"{motion.error_mm:.1f}"
            figures = (motion.plays, seconds, part_of(motion.part), seam_of(motion.part), error)
        rows.append((motion.name, *figures, verdict))
    show_table(
        ("motion", "plays", "seconds", "of the recording", "best seam", "error, mm", "self-test"),
        rows,
        title=f"{learned.library.info.name}: {counted(len(learned.library.info.motions), 'motion')}",
        left=("plays", "self-test"),
    )
    for motion in learned.motions:
        if motion.plays and not motion.file.stem.isascii():  # its name says little or nothing about the file
            print(f"{motion.name}: learned from {motion.file.name}")
    for motion in learned.failed:
        print(f"{motion.name} ({motion.file.name}): {motion.remedy}")
    doubtful: dict[str, list[str]] = {}
    for motion in learned.motions:
        for doubt in motion.doubts:
            doubtful.setdefault(doubt, []).append(motion.name)
    for doubt, names in doubtful.items():
        print(f"doubt: {', '.join(names)}: {doubt}")
