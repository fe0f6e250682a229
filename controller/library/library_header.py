"""The header of a motion library: which motions, whose body, which network, and where it all comes from."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from controller.library.recording_error import RecordingError
from controller.motion.encodings.encoding import ENCODINGS, Encoding
from controller.motion.skeleton import SkeletonInfo
from controller.networks.registry import network_kind
from controller.networks.storage import FEWEST_ANCHORS, MotionHeader, NetworkHeader
from motiondeck_base.errors import FileFormatError, UnknownNameError
from motiondeck_base.files import way_from
from motiondeck_base.toml_file import shaped

VERSION = 7
# Read as well: 2 brought phase-driven conceptors, 3 centralized networks with weights of low rank, 4 inputs of motions,
# 5 phase-driven echo-state networks, 7 a body of each motion, and libraries baked for a robot.
OLDER = (1, 2, 3, 4, 5, 6)
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
    try:
        network_kind(info.network)
        if info.encoding not in ENCODINGS:
            raise UnknownNameError.among("encoding", info.encoding, ENCODINGS)
    except UnknownNameError as error:
        raise FileFormatError(f"{path} (header): {error}") from None
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


def portable(info: LibraryInfo, folder: Path) -> LibraryInfo:
    """The header for a file in a folder: recordings below it by their way from there, others by their names alone."""

    def named(file: str) -> str:
        way = way_from(folder, file)
        return Path(file).name if way.startswith("../") else way

    motions = [msgspec.structs.replace(motion, source=named(motion.source)) for motion in info.motions]
    return msgspec.structs.replace(info, motions=motions, recipe=with_ways(info.recipe, named))


def with_ways(tree: dict[str, Any], named: Callable[[str], str]) -> dict[str, Any]:
    """A recipe, as plain values, whose files are named otherwise."""
    files = {key: named(tree[key]) for key in ("body", "file", "skeleton") if tree.get(key)}
    many = {"takes": [named(take) for take in tree["takes"]]} if tree.get("takes") else {}
    below = {"motions": [with_ways(motion, named) for motion in tree["motions"]]} if tree.get("motions") else {}
    return tree | files | many | below


def encoding_in(path: Path, info: LibraryInfo) -> Encoding:
    """The encoding of a library, by its header; FileFormatError if its skeleton is damaged."""
    try:
        return ENCODINGS[info.encoding].restore(info.skeleton)
    except FileFormatError as error:
        raise FileFormatError(f"{path}: {error}") from None
