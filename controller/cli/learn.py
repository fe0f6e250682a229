"""`motiondeck learn`: a library of any recordings, in one command."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from controller.training.learn import LearnedLibrary


def learn(
    recordings: Annotated[
        list[Path],
        typer.Argument(metavar="FILE_OR_FOLDER...", help="Recordings in any format, and folders that hold some."),
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE", help="Where the library goes; its recipe goes beside it, as .toml.")
    ] = Path("mine.safetensors"),
    play: Annotated[bool, typer.Option("--play", help="Play the first motion afterwards.")] = False,
    robot: Annotated[str | None, typer.Option("--robot", help="The robot that plays: a robot file or name.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")] = False,
) -> None:
    """Learn a library from recordings: nothing to choose, no recipe to write.

    Still ends are trimmed; a recording whose best seam is close becomes a loop, any other a one-shot that ends in a
    pose; all are brought to 120 Hz and carried to one body. Every motion is then tested. Recordings that cannot be
    read are left out, and the table names the reason.

    [bold]Examples[/]

      motiondeck learn walk.bvh dance.c3d --play

      motiondeck learn recordings --out mine.safetensors --play --robot servo20
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from controller.library.motion_library import save_library
    from controller.mocap.formats.writing import write_file
    from controller.training import learn as learning
    from controller.training.recipe_text import recipe_text
    from motiondeck_base.errors import MotiondeckError

    if out.suffix.lower() != ".safetensors":
        raise MotiondeckError(f"{out}: a library ends in .safetensors. Name the file so.")
    if not out.absolute().parent.is_dir():
        raise MotiondeckError(f"{out.parent}: there is no such folder to write the library to")
    if robot is not None and not play:
        raise MotiondeckError("--robot names who plays: give --play too")
    console = Console(stderr=True)
    columns = (TextColumn("{task.description:44}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, disable=not sys.stderr.isatty(), transient=True) as bar:
        total = 2 * len(learning.recordings_in(recordings)) + 2
        task = bar.add_task("", total=total)

        def progress(step: str) -> None:
            bar.update(task, advance=1, description=step)

        learned = learning.learn(recordings, out.stem, progress=progress)
    save_library(learned.library, out)
    recipe = out.with_suffix(".toml")
    write_file(recipe, recipe_text(learned.recipe).encode())
    if as_json:
        print(json.dumps({"written": str(out), "recipe": str(recipe), "motions": _rows(learned)}))
    else:
        _print(learned)
        print(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB) and its recipe {recipe}")
    if play:
        first = next((motion.name for motion in learned.motions if motion.passed), learned.motions[0].name)
        command = [sys.executable, "-P", "-m", "motiondeck", "play", first, "--library", str(out.absolute())]
        os.execv(sys.executable, [*command, *([] if robot is None else ["--robot", robot])])


def _rows(learned: LearnedLibrary) -> list[dict[str, Any]]:
    """One entry a recording; numbers that there are none of are null."""
    rows: list[dict[str, Any]] = []
    for motion in learned.motions:
        known = bool(motion.plays)
        rows.append(
            {
                "name": motion.name,
                "file": str(motion.file),
                "plays": motion.plays or None,
                "seconds": motion.seconds if known else None,
                "seam_mm": motion.seam_mm if known else None,
                "seam_degrees": motion.seam_degrees if known else None,
                "error_mm": motion.error_mm if known else None,
                "passed": motion.passed,
                "remedy": motion.remedy,
            }
        )
    return rows


def _print(learned: LearnedLibrary) -> None:
    """One row a recording, then what to do about those that failed."""
    from controller.cli.common.tables import show_table

    rows: list[tuple[str, ...]] = []
    for motion in learned.motions:
        verdict = "[green]passed[/]" if motion.passed else "[red]failed[/]" if motion.plays else "[red]left out[/]"
        figures = ("", "", "", "")
        if motion.plays:
            seam = f"{motion.seam_mm:.0f} mm, {motion.seam_degrees:.0f}°"
            figures = (motion.plays, f"{motion.seconds:.2f}", seam, f"{motion.error_mm:.1f}")
        rows.append((motion.name, *figures, verdict))
    show_table(
        ("motion", "plays", "seconds", "best seam", "error, mm", "self-test"),
        rows,
        title=f"{learned.library.info.name}: {len(learned.library.info.motions)} motions",
        left=("plays", "self-test"),
    )
    for motion in learned.failed:
        print(f"{motion.name} ({motion.file.name}): {motion.remedy}")
