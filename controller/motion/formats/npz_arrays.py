"""Arrays of numbers in .npy and .npz files; pickled objects are never loaded."""

import io
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import listed, read_bytes

Kind = TypeVar("Kind", np.float64, np.str_)
_RATES = ("mocap_framerate", "mocap_frame_rate", "framerate", "frame_rate", "fps")
_MOST_BYTES = 2**30  # of an array once unpacked
# Errors of a broken archive or array: numpy reads headers with Python's own parser.
_BROKEN = (ValueError, TypeError, SyntaxError, EOFError, OverflowError, MemoryError, OSError, RuntimeError, KeyError)
_BROKEN += (zipfile.BadZipFile, zlib.error, tokenize.TokenError)


def npz_names(path: Path) -> set[str]:
    """The names of the arrays in an .npz file; empty if it is none."""
    try:
        with zipfile.ZipFile(path) as archive:
            return {name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")}
    except _BROKEN:
        return set()


def plain_array(content: bytes, what: str, kind: type[Kind] = np.float64) -> NDArray[Kind]:
    """The array in the bytes of a .npy file; FileFormatError, which begins with `what`, if it is of another kind."""
    try:
        return np.asarray(np.lib.format.read_array(io.BytesIO(content), allow_pickle=False), dtype=kind)
    except _BROKEN as error:
        reason = "it holds Python objects, which are never loaded" if "bject" in str(error) else str(error)
    short = " ".join(reason.split())[:120]
    raise FileFormatError(f"{what} cannot be read ({short}). Save it again as plain numbers.")


class NpzArrays:
    """The arrays of numbers in an .npz file, a zip of .npy files; pickled objects are never loaded."""

    def __init__(self, path: str | Path) -> None:
        self._path = path
        content = read_bytes(path, archive=True)
        try:
            self._archive = zipfile.ZipFile(io.BytesIO(content))
        except (zipfile.BadZipFile, NotImplementedError, ValueError) as error:
            raise FileFormatError(f"{path}: this is no .npz file ({error}). Is it the right one?") from None
        entries = [entry for entry in self._archive.infolist() if entry.filename.endswith(".npy")]
        self._sizes = {entry.filename[: -len(".npy")]: entry.file_size for entry in entries}
        self.names = list(self._sizes)

    def first(self, *names: str) -> Array | None:
        """The first of these arrays that exists, as float64, or None; FileFormatError if it is none or too large."""
        name = next((name for name in names if name in self._sizes), None)
        return None if name is None else self._read(name, np.float64)

    def words(self, *names: str) -> tuple[str, ...] | None:
        """The first of these arrays that exists, as text, or None."""
        name = next((name for name in names if name in self._sizes), None)
        return None if name is None else tuple(str(word) for word in self._read(name, np.str_).ravel())

    def rate(self) -> float:
        """The rate, Hz; FileFormatError if there is none, or it is impossible."""
        rate, time = self.first(*_RATES), self.first("time")
        if rate is None and time is not None and len(time) > 1:
            rate = (len(time) - 1) / (time[-1:] - time[:1])
        if rate is None:
            raise FileFormatError(f"{self._path}: no rate (it holds {listed(self.names)}). Add an array 'fps', Hz.")
        hertz = float(rate.ravel()[0]) if rate.size else 0.0
        if not 0.1 <= hertz <= 1e5:
            raise FileFormatError(f"{self._path}: a rate of {hertz:g} frames per second is not possible.")
        return hertz

    def _read(self, name: str, kind: type[Kind]) -> NDArray[Kind]:
        what = f"{self._path}: array '{name}'"
        if self._sizes[name] > _MOST_BYTES:
            raise FileFormatError(f"{what} would take {self._sizes[name] >> 20} MiB. Save less of it.")
        try:
            with self._archive.open(f"{name}.npy") as entry:
                packed = entry.read(_MOST_BYTES + 1)
        except _BROKEN as error:
            short = " ".join(str(error).split())[:120]
            raise FileFormatError(f"{what} cannot be read ({short}). Save it again.") from None
        return plain_array(packed, what, kind)
