"""Large arrays in temporary files that have no name, so that memory holds those in use only."""

import mmap
import resource
from contextlib import suppress
from ctypes import CDLL
from functools import cache
from tempfile import TemporaryFile
from typing import Any
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

SMALL = 1 << 16  # bytes: a smaller array stays in memory
_MAPPED = WeakSet[mmap.mmap]()


def return_freed_arrays() -> None:
    """Has the C library return memory of large arrays to the system once they are freed, where it can (glibc)."""
    with suppress(AttributeError, OSError):
        set_option = CDLL(None).mallopt
        set_option(-3, 4 << 20)  # M_MMAP_THRESHOLD, bytes; else it grows with what was freed
        set_option(-1, 16 << 20)  # M_TRIM_THRESHOLD


@cache
def _allow_many_files() -> None:
    """Each array keeps its file open, and a library of some hundred motions has more than the usual 1024."""
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    with suppress(ValueError, OSError):  # where the hard limit is more than the system allows
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def on_disk(array: NDArray[Any]) -> NDArray[Any]:
    """A copy of an array in a temporary file without a name; memory holds what was used of it since `release`."""
    if array.nbytes < SMALL:
        return array.copy()
    _allow_many_files()
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
