"""A motion library: one file with the networks, the skeleton, and where it all comes from.

The file is safetensors: a JSON header and plain arrays, so that loading executes nothing. What is not an array lies in
the header under "motiondeck" (see docs/library-format.md). Every name, shape and number is checked before it is used.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import msgspec
import numpy as np

from controller.library.recording_error import RecordingError
from controller.motion.canonical.canonical_body import is_canonical, offsets_at_rest
from controller.motion.encodings.encoding import ENCODINGS, Encoding
from controller.motion.rotations import Array
from controller.motion.skeleton import Skeleton, SkeletonInfo
from controller.networks.base import AnyNetwork
from controller.networks.registry import network_kind
from controller.networks.storage import FEWEST_ANCHORS, MotionHeader, NetworkHeader, StoredNetwork
from motiondeck_base.arrays_file import Kind, StoredArrays, read_arrays, write_arrays
from motiondeck_base.errors import FileFormatError, MotiondeckError, UnknownNameError
from motiondeck_base.files import way_from
from motiondeck_base.toml_file import shaped

VERSION = 9
# Read as well: 2 brought phase-driven conceptors, 3 centralized networks with weights of low rank, 4 inputs of motions,
# 5 phase-driven echo-state networks, 7 a body of each motion, and libraries baked for a robot, 8 directions in 8 bits,
# 9 loops in step.
OLDER = (1, 2, 3, 4, 5, 6, 7, 8)
MOST_NEURONS, MOST_HARMONICS = 20_000, 100


class MotionInfo(MotionHeader, frozen=True, kw_only=True):
    """A motion in the header of a library."""

    source: str  # the file that it was learned from, without the way to it outside the library's folder
    nrmse: float  # of the readout over training, mean over channels (Jaeger's nrmse.m)
    error_mm: float  # of the self-test: distance to what was trained at the end of the free run, mm
    passed: bool  # whether it passed the self-test, and is as near to its recording as it must be
    reason: str = ""  # why not, or ""
    against_recording: RecordingError | None = None  # None where there is no recording to compare with
    body: SkeletonInfo | None = None  # of the recording, with its own lengths of limbs; None if it is not known


class BakedFrom(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The origin of a library whose motions were carried to a robot beforehand."""

    robot: str  # the name of its file
    robot_digest: str  # of all its files
    library: str  # the name of the library of human motions
    library_digest: str  # of its file
    leaps: dict[str, dict[str, float]]  # between its motions, m, as `routes.leap` has them


class LibraryInfo(NetworkHeader, frozen=True, kw_only=True):
    """The header of a library."""

    version: int  # of the format
    name: str
    network: str
    encoding: str
    motions: list[MotionInfo]
    skeleton: SkeletonInfo  # of the body that its motions are on
    recipe: dict[str, Any]  # of the training, as it was read
    licence: str  # terms under which the library may be passed on
    acknowledgement: str  # that the owners of the data ask for
    baked: BakedFrom | None = None  # None for a library of recordings


def read_header(path: Path, tree: object) -> LibraryInfo:
    """The header of a library file, checked; a FileFormatError names in one line the file and what is wrong."""
    info = shaped(tree, LibraryInfo, f"{path} (header)")
    with FileFormatError.placed(f"{path} (header)"):
        network_kind(info.network)
        UnknownNameError.check("encoding", info.encoding, ENCODINGS)
    names = [motion.name for motion in info.motions]
    if not names or len(set(names)) < len(names):
        raise FileFormatError(f"{path}: its header names no motion, or one twice")
    if not (1.0 <= info.rate <= 1000.0 and 0.0 < info.leak <= 1.0):
        raise FileFormatError(f"{path}: rate {info.rate} Hz or leak {info.leak} is impossible")
    scales = info.scales
    if scales is not None and not (
        1 <= scales.neurons <= MOST_NEURONS
        and 1 <= scales.harmonics <= MOST_HARMONICS
        and info.seed >= 0
        and all(0.0 <= value <= 1e3 for value in msgspec.structs.astuple(scales)[2:])
    ):
        raise FileFormatError(f"{path}: no weights can be drawn with seed {info.seed} and {scales}")
    leaps = info.baked.leaps if info.baked is not None else dict.fromkeys(names, dict.fromkeys(names, 0.0))
    if any(not 0.0 <= leaps.get(one, {}).get(other, -1.0) < 1e3 for one in names for other in names):
        raise FileFormatError(f"{path}: its header does not say how far its motions are apart")
    for motion in info.motions:
        if not (motion.name and motion.frames >= FEWEST_ANCHORS):
            raise FileFormatError(f"{path}: its header has a motion '{motion.name}' of {motion.frames} frames")
        if motion.input is not None and not (
            motion.input.possible and motion.plays == "loop" and scales and scales.drive_scale
        ):
            raise FileFormatError(f"{path}: motion '{motion.name}' cannot have the input {motion.input}")
    return info


def with_ways(tree: dict[str, Any], named: Callable[[str], str]) -> dict[str, Any]:
    """A recipe, as plain values, whose files are named otherwise."""
    files = {key: named(tree[key]) for key in ("body", "file", "skeleton") if tree.get(key)}
    many = {"takes": [named(take) for take in tree["takes"]]} if tree.get("takes") else {}
    below = {"motions": [with_ways(motion, named) for motion in tree["motions"]]} if tree.get("motions") else {}
    return tree | files | many | below


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

    def offsets(self, motion: str) -> Array:
        """The offsets (B, 3), m, of that body, with legs as long as the library's; the library's if bones differ."""
        skeleton, body = self.skeleton, self.body(motion)
        if body is skeleton or set(body.bones) != set(skeleton.bones):
            return skeleton.offsets
        order = [body.bones.index(bone) for bone in skeleton.bones]
        if np.array_equal(body.length[order], skeleton.length):
            return skeleton.offsets
        canonical = is_canonical(body) and is_canonical(skeleton)
        at_rest = body.length[order, None] * skeleton.rest_direction
        own = skeleton.with_offsets(offsets_at_rest(body, skeleton) if canonical else at_rest)
        return own.offsets * (skeleton.leg_length / own.leg_length)


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


def without_motion(library: MotionLibrary, motion: str) -> MotionLibrary:
    """A library without one of its motions; what is stored of the others stays bit for bit the same.

    UnknownNameError if there is no such motion; MotiondeckError if it is the last.
    """
    info = library.info
    UnknownNameError.check("motion", motion, library.network.motions)
    if not (kept := [one for one in info.motions if one.name != motion]):
        raise MotiondeckError(f"'{motion}' is the only motion of the library '{info.name}'; a library has at least one")
    recipe = info.recipe | {"motions": [one for one in info.recipe.get("motions", []) if one.get("name") != motion]}
    if (baked := info.baked) is not None:
        names = [one.name for one in kept]
        leaps = {one: {other: baked.leaps[one][other] for other in names} for one in names}
        baked = msgspec.structs.replace(baked, leaps=leaps)
    info = msgspec.structs.replace(info, motions=kept, recipe=recipe, baked=baked)
    at = f"motion/{motion}/"
    arrays = {name: array for name, array in library.network.arrays().items() if not name.startswith(at)}
    stored = StoredNetwork(StoredArrays(Path(info.name), arrays), info, library.encoding.channels)
    return MotionLibrary(info, library.network.load(stored), library.encoding)


def save_library(library: MotionLibrary, path: Path) -> None:
    """Writes a library whole or not at all, without absolute paths; FileFormatError if the folder cannot be written."""
    info = library.info

    def named(file: str) -> str:  # recordings below the folder by their way from there, others by their names alone
        way = way_from(path.parent, file)
        return Path(file).name if way.startswith("../") else way

    motions = [msgspec.structs.replace(motion, source=named(motion.source)) for motion in info.motions]
    info = msgspec.structs.replace(info, motions=motions, recipe=with_ways(info.recipe, named))
    write_arrays(path, KIND, info, library.network.arrays())


def load_library(path: Path) -> MotionLibrary:
    """Reads and checks a library; a FileFormatError names in one line the file and what is wrong."""
    header, stored = read_arrays(path, KIND)
    info = read_header(path, header)
    with FileFormatError.placed(path):
        encoding = ENCODINGS[info.encoding].restore(info.skeleton)
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
        with FileFormatError.placed(f"{path}: body of motion '{motion}'"):
            body = library.body(motion)
        if not (set(body.bones) == set(encoding.skeleton.bones) or is_canonical(body)):
            raise FileFormatError(f"{path}: body of motion '{motion}' has bones of another skeleton")
    return library
