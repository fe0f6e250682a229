"""The arrays of numbers in an .npz file, which is a zip of .npy files; pickled objects are never loaded."""

from __future__ import annotations

import io
import tokenize
import zipfile
import zlib
from pathlib import Path

import numpy as np

from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import read_bytes

MOST_BYTES = 2**30  # of an array once unpacked
# What a broken archive or array can raise: numpy reads headers with Python's own parser.
_BROKEN = (ValueError, TypeError, SyntaxError, EOFError, OverflowError, MemoryError, OSError, RuntimeError, KeyError)
_BROKEN += (zipfile.BadZipFile, zlib.error, tokenize.TokenError)


class NpzArrays:
    """What an .npz file holds.

    Raises:
        FileFormatError: naming the file, if it is not an .npz file.
    """

    def __init__(self, path: str | Path) -> None:
        self._path = path
        content = read_bytes(path)
        try:
            self._archive = zipfile.ZipFile(io.BytesIO(content))
        except (zipfile.BadZipFile, NotImplementedError, ValueError) as error:
            raise FileFormatError(f"{path}: this is no .npz file ({error}). Is it the right one?") from None
        entries = [entry for entry in self._archive.infolist() if entry.filename.endswith(".npy")]
        self._sizes = {entry.filename[: -len(".npy")]: entry.file_size for entry in entries}

    @property
    def names(self) -> list[str]:
        """What the file holds."""
        return list(self._sizes)

    def first(self, *names: str) -> Array | None:
        """The first of these arrays that is there, as float64.

        Raises:
            FileFormatError: if it is not an array of numbers, or too large.
        """
        name = next((name for name in names if name in self._sizes), None)
        if name is None:
            return None
        if self._sizes[name] > MOST_BYTES:
            raise FileFormatError(f"{self._path}: array '{name}' would take {self._sizes[name] >> 20} MiB.")
        try:
            with self._archive.open(f"{name}.npy") as entry:
                packed = entry.read(MOST_BYTES + 1)
            array = np.lib.format.read_array(io.BytesIO(packed), allow_pickle=False)
            return np.asarray(array, dtype=np.float64)
        except _BROKEN as error:
            reason = "it holds Python objects, which are never loaded" if "bject" in str(error) else str(error)
        short = " ".join(reason.split())[:120]
        raise FileFormatError(f"{self._path}: array '{name}' cannot be read ({short}). Save it again as plain numbers.")
