"""Options that several commands share, and the check of files that are to be written."""

from __future__ import annotations

from pathlib import Path

from motiondeck_base.errors import MotiondeckError

PAGE_PORT = 8040


def check_folder(*files: Path | None) -> None:
    """Checks, before anything is computed, that the folders exist that files are to be written to.

    Raises:
        MotiondeckError: if one does not.
    """
    for file in files:
        if file is not None and not file.absolute().parent.is_dir():
            raise MotiondeckError(f"{file.parent}: there is no such folder to write {file.name} to")
