"""What the recognition commands share: reading labelled recordings, and the exit code for skipped files."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motiondeck_base.progress import progress

if TYPE_CHECKING:
    from controller.learning.recognition.labelled_recordings import Dataset

# Exit code: some files could not be used and were left out.
SKIPPED_EXIT = 3

DataArgument = Annotated[
    Path, typer.Argument(metavar="DATA", help="A folder with one folder of recordings for each motion.")
]


def read(data: Path) -> Dataset:
    """The dataset in a folder, with a progress bar; files that cannot be used are named on stderr."""
    from controller.learning.recognition.labelled_recordings import read_dataset

    with progress("reading", None) as tick:
        dataset = read_dataset(data, lambda count, total: tick(f"reading {count} of {total}"))
    for line in dataset.skipped:
        print(f"skipped: {line}", file=sys.stderr)
    return dataset


def leave(dataset: Dataset) -> None:
    """Ends the command; the exit code says whether files were skipped."""
    if dataset.skipped:
        raise typer.Exit(SKIPPED_EXIT)
