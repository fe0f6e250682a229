"""What the recognition commands share: reading labelled recordings, progress, and the exit code for skipped files."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from controller.recognition.labelled_recordings import Dataset

# Some files could not be used, and the rest was done without them.
SKIPPED_EXIT = 3

DataArgument = Annotated[
    Path, typer.Argument(metavar="DATA", help="A folder with one folder of recordings for each motion.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")]


def read(data: Path) -> Dataset:
    """The dataset in a folder, with a progress bar; files that cannot be used are named on stderr."""
    from controller.recognition.labelled_recordings import read_dataset

    with steps(None) as done:
        dataset = read_dataset(data, lambda count, total: done(f"reading {count} of {total}"))
    for line in dataset.skipped:
        print(f"skipped: {line}", file=sys.stderr)
    return dataset


@contextmanager
def steps(total: int | None) -> Iterator[Callable[[str], None]]:
    """A progress bar on a terminal, nothing in a pipe; call what it gives with the name of the next step."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:44}"), BarColumn(), TimeElapsedColumn())
    quiet = not sys.stderr.isatty()
    with Progress(*columns, console=Console(stderr=True), disable=quiet, transient=True) as bar:
        task = bar.add_task("", total=total)
        yield lambda name: bar.update(task, advance=1, description=name)


def leave(dataset: Dataset) -> None:
    """Ends the command; the exit code says whether files were skipped."""
    if dataset.skipped:
        raise typer.Exit(SKIPPED_EXIT)
