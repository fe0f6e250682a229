"""A motion library: one file with the networks, the skeleton, and where it all comes from.

The file is safetensors: a JSON header and plain arrays, so that loading executes nothing. What is not an array lies in
the header under "motiondeck" (see docs/library-format.md). Every name, shape and number is checked before it is used.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from controller.library.library_header import OLDER, VERSION, LibraryInfo, encoding_in, portable, read_header
from controller.motion.canonical.canonical_body import is_canonical
from controller.motion.encodings.encoding import Encoding
from controller.motion.skeleton import Skeleton
from controller.networks.base import AnyNetwork
from controller.networks.registry import network_kind
from controller.networks.storage import StoredNetwork
from motiondeck_base.arrays_file import Kind, read_arrays, write_arrays
from motiondeck_base.errors import FileFormatError

LARGEST_CHANNEL = 100.0  # of a frame: m, m/s, rad/s or rad; the shipped libraries stay below 10

KIND = Kind("motion library", "motiondeck", VERSION, "`motiondeck learn`", OLDER)


@dataclass(frozen=True, eq=False)
class MotionLibrary:
    """A library in memory; two are the same only if they are one object."""

    info: LibraryInfo
    network: AnyNetwork
    encoding: Encoding

    @property
    def skeleton(self) -> Skeleton:
        """The body of the motions."""
        return self.encoding.skeleton

    def body(self, motion: str) -> Skeleton:
        """The body of a motion's recording: the library's with other lengths, or the canonical one."""
        info = next(info for info in self.info.motions if info.name == motion)
        return self.skeleton if info.body is None else Skeleton.restore(info.body)


Found = TypeVar("Found")


def once_a_library(find: Callable[[MotionLibrary], Found]) -> Callable[[MotionLibrary], Found]:
    """Has a pure function of a library computed once, and remembered for as long as the library is in memory."""
    known: WeakKeyDictionary[MotionLibrary, Found] = WeakKeyDictionary()

    @wraps(find)
    def remembered(library: MotionLibrary) -> Found:
        if library not in known:
            known[library] = find(library)
        return known[library]

    return remembered


def save_library(library: MotionLibrary, path: Path) -> None:
    """Writes a library whole or not at all, without absolute paths; FileFormatError if the folder cannot be written."""
    write_arrays(path, KIND, portable(library.info, path.parent), library.network.arrays())


def load_library(path: Path) -> MotionLibrary:
    """Reads and checks a library; a FileFormatError names in one line the file and what is wrong."""
    header, stored = read_arrays(path, KIND)
    info = read_header(path, header)
    encoding = encoding_in(path, info)
    network = network_kind(info.network).load(StoredNetwork(stored, info, encoding.channels))
    stored.finish()
    for motion in network.motions:
        with np.errstate(over="ignore", invalid="ignore"):
            largest = float(np.abs(network.recall(motion)).max(initial=0.0))
        if not largest < LARGEST_CHANNEL:
            raise FileFormatError(
                f"{path}: motion '{motion}' reads out {largest:.3g}, which no body does (m, m/s, rad/s; "
                f"{LARGEST_CHANNEL:g} is the most). The file is damaged: make it again with {KIND.made_by}."
            )
    library = MotionLibrary(info, network, encoding)
    for motion in network.motions:
        try:
            body = library.body(motion)
        except FileFormatError as error:
            raise FileFormatError(f"{path}: body of motion '{motion}': {error}") from None
        if not (set(body.bones) == set(encoding.skeleton.bones) or is_canonical(body)):
            raise FileFormatError(f"{path}: body of motion '{motion}' has bones of another skeleton")
    return library
