"""Arrays by name in a temporary file that has no name, so that memory holds those in use only."""

import mmap
import os
from collections.abc import Iterator, MutableMapping
from contextlib import suppress
from ctypes import CDLL
from tempfile import TemporaryFile
from typing import Any
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def return_freed_arrays() -> None:
    """Has the C library return memory of large arrays to the system once they are freed, where it can (glibc)."""
    with suppress(AttributeError, OSError):
        set_option = CDLL(None).mallopt
        set_option(-3, 4 << 20)  # M_MMAP_THRESHOLD, bytes; else it grows with what was freed
        set_option(-1, 16 << 20)  # M_TRIM_THRESHOLD


_MAPPED = WeakSet[mmap.mmap]()


def on_disk(array: NDArray[Any]) -> NDArray[Any]:
    """A copy of an array in a temporary file without a name; memory holds what was used of it since `release`."""
    with TemporaryFile() as file:
        file.write(np.ascontiguousarray(array).data)
        file.flush()
        _MAPPED.add(mapped := mmap.mmap(file.fileno(), 0))
    return np.frombuffer(mapped, array.dtype).reshape(array.shape)


def release() -> None:
    """Returns memory of freed arrays, and of those by `on_disk`, to the system, where it can."""
    for mapped in _MAPPED:
        mapped.madvise(mmap.MADV_DONTNEED)
    with suppress(AttributeError, OSError):
        CDLL(None).malloc_trim(0)


class ArraysOnDisk(MutableMapping[str, Array]):
    """Arrays of float64; each access reads its own copy. Pickled, it is a dictionary."""

    def __init__(self) -> None:
        self._file = TemporaryFile()  # noqa: SIM115 (closed with this object)
        self._places: dict[str, tuple[int, tuple[int, ...]]] = {}  # first byte and shape

    def __setitem__(self, name: str, array: Array) -> None:
        self._places[name] = self._file.seek(0, os.SEEK_END), array.shape
        self._file.write(np.ascontiguousarray(array, dtype=np.float64).data)

    def __getitem__(self, name: str) -> Array:
        first, shape = self._places[name]
        out = np.empty(shape)
        self._file.seek(first)
        self._file.readinto(out.data)
        return out

    def __delitem__(self, name: str) -> None:
        del self._places[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def __reduce__(self) -> tuple[type, tuple[dict[str, Array]]]:
        return dict, (dict(self),)
