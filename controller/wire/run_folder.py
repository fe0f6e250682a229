"""Temporary folders that the processes of a run share; the next run removes those of killed runs."""

import contextlib
import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from motiondeck_base.errors import MotiondeckError

REASON_FILE = "ended"  # the file beside the state of a run in which its page reads why the run has ended

_PREFIX = "motiondeck-"
_LOCK = "in-use"


@contextmanager
def run_folder() -> Iterator[Path]:
    """A folder of the user's own (0700) in TMPDIR, gone after the block; MotiondeckError if it cannot be made."""
    try:
        root = Path(tempfile.gettempdir())
        _remove_abandoned(root)
        folder, lock = _locked_folder(root)
    except OSError as error:
        raise MotiondeckError(
            f"no temporary folder can be made ({error.strerror or error}). Free some room, or set TMPDIR to another"
        ) from error
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock)


def _locked_folder(root: Path) -> tuple[Path, int]:
    """A new folder and its lock, which is released when this process ends, even if it is killed."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=root))
        lock = os.open(folder / _LOCK, os.O_CREAT | os.O_RDWR, 0o600)
        fcntl.flock(lock, fcntl.LOCK_EX)
        if os.fstat(lock).st_nlink:
            return folder, lock
        os.close(lock)  # before it was locked, another run took it for abandoned


def allocate(file: int, size: int, path: Path) -> None:
    """Allocates an open file, as writing to a sparse map on a full disk would kill; MotiondeckError if it is full."""
    try:
        os.posix_fallocate(file, 0, size)
    except OSError as error:
        raise _no_room(path, size, error) from error


def write_shared(path: Path, text: str) -> None:
    """Writes a text into the folder of a run; raises a MotiondeckError if there is no room for it."""
    try:
        path.write_text(text)
    except OSError as error:
        raise _no_room(path, len(text), error) from error


def _no_room(path: Path, size: int, error: OSError) -> MotiondeckError:
    return MotiondeckError(
        f"{path.parent}: no room for {max(size // 1000, 1)} kB that the processes of a run share "
        f"({error.strerror or error}). Free some, or set TMPDIR to a folder with room"
    )


def _remove_abandoned(root: Path) -> None:
    for folder in root.glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError):
            if folder.is_symlink() or folder.stat().st_uid != os.getuid():
                continue
            lock = os.open(folder / _LOCK, os.O_RDWR)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder)
            finally:
                os.close(lock)
