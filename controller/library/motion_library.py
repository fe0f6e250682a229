"""A motion library: one file with the networks, the skeleton, and where it all comes from.

The file is safetensors: a JSON header and plain arrays, so that loading executes nothing. What is not an array lies in
the header under "motiondeck" (see docs/library-format.md). Every name, shape and number is checked before anything is
used.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from controller.arrays_file import Kind, StoredArrays, read_arrays, write_arrays
from controller.mocap.encodings.bone_directions import BoneDirections
from controller.mocap.encodings.encoding import Encoding
from controller.mocap.encodings.joint_angles import JointAngles, JointBody
from controller.mocap.encodings.joint_rotations import JointRotations
from controller.mocap.encodings.normalisation import Normalisation
from controller.mocap.skeleton import Skeleton
from controller.networks.centralized_frames import CentralizedNetwork, StoredMotion
from controller.networks.conceptor import ConceptorMotion, ConceptorNetwork, Memory
from controller.networks.echo_state import EchoStateMotion, EchoStateNetwork
from controller.networks.random_feature_conceptor import FeatureMotion, FeatureReservoir, RandomFeatureNetwork
from motiondeck_base.errors import FileFormatError, MotiondeckError
from motiondeck_base.toml_file import shaped

VERSION = 1
KIND = Kind("motion library", "motiondeck", VERSION, "`motiondeck fit`")
FEWEST_ANCHORS = 3  # with fewer nobody can tell how a motion moves

Network = ConceptorNetwork | EchoStateNetwork | RandomFeatureNetwork
AnyNetwork = Network | CentralizedNetwork


class MotionInfo(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """What a library knows of one motion.

    Attributes:
        name: what it is called.
        plays: "loop" goes on for ever, "once" ends in a pose and holds it.
        frames: how many frames it was learned from.
        source: the file it was learned from.
        nrmse: of the readout over training, mean over channels (Jaeger's nrmse.m).
        error_mm: median distance to the recorded motion at the end of the free run, mm.
        passed: whether the self-test passed.
        reason: why not, or "".
    """

    name: str
    plays: Literal["loop", "once"]
    frames: int
    source: str
    nrmse: float
    error_mm: float
    passed: bool
    reason: str = ""


class SkeletonInfo(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A skeleton as the header spells it (see `mocap.skeleton`); the joints of a rig have no hips."""

    name: str
    bones: list[str]
    parent: list[int]
    rest_direction: list[list[float]]
    length: list[float]
    right_hip: str
    left_hip: str


class LibraryInfo(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The header of a library.

    Attributes:
        version: of the format.
        name: of the library.
        network: which kind of network plays it.
        encoding: what its channels mean.
        rate: frames per second.
        seed: of everything random in training.
        motions: what it holds.
        skeleton: whose motions they are.
        recipe: the training recipe, as it was read.
        licence: terms under which the library may be passed on.
        acknowledgement: what the owners of the data ask to be said.
        leak: of an echo-state network, else 1.
        clipped: whether an echo-state network keeps its state and output in the range of training.
    """

    version: int
    name: str
    network: Literal["conceptor", "echo-state", "random-feature", "centralized"]
    encoding: Literal["bone directions", "joint rotations", "joint angles"]
    rate: float
    seed: int
    motions: list[MotionInfo]
    skeleton: SkeletonInfo
    recipe: dict[str, Any]
    licence: str
    acknowledgement: str
    leak: float = 1.0
    clipped: bool = True


@dataclass(frozen=True)
class MotionLibrary:
    """A library in memory.

    Attributes:
        info: the header.
        network: what plays the motions.
        encoding: between the network's channels and postures.
    """

    info: LibraryInfo
    network: AnyNetwork
    encoding: Encoding

    @property
    def reservoir(self) -> Network:
        """The network, where only one with a reservoir will do.

        Raises:
            MotiondeckError: if it is a centralized one.
        """
        if isinstance(self.network, CentralizedNetwork):
            raise MotiondeckError(
                f"library '{self.info.name}' holds a centralized network; this is for reservoirs only"
            )
        return self.network

    @property
    def skeleton(self) -> Skeleton:
        """Whose motions these are."""
        return self.encoding.skeleton


def describe_skeleton(encoding: Encoding) -> SkeletonInfo:
    """A skeleton as the header spells it."""
    skeleton = encoding.skeleton
    return SkeletonInfo(
        skeleton.name,
        list(skeleton.bones),
        skeleton.parent.tolist(),
        skeleton.rest_direction.tolist(),
        skeleton.length.tolist(),
        *((encoding.right_hip, encoding.left_hip) if isinstance(encoding, BoneDirections) else ("", "")),
    )


def save_library(library: MotionLibrary, path: Path) -> None:
    """Writes a library under a temporary name and renames it, so that a file is whole or not there.

    Raises:
        FileFormatError: if the folder cannot be written.
    """
    arrays: dict[str, NDArray[Any]] = {}
    network = library.network
    for motion in network.motions:
        part = network[motion]
        for field in fields(part):
            arrays[f"motion/{motion}/{field.name}"] = getattr(part, field.name)
    if isinstance(network, ConceptorNetwork) and network.memory is not None:
        memory, normalisation = network.memory, network.memory.normalisation
        arrays |= {f"memory/{name}": getattr(memory, name) for name in ("estimate", "readout", "means")}
        arrays |= {"memory/shift": normalisation.shift, "memory/scaling": normalisation.scaling}
    if isinstance(network, EchoStateNetwork):
        arrays |= {"weights": network.weights, "feedback": network.feedback, "bias": network.bias}
        arrays |= {"shift": network.normalisation.shift, "scaling": network.normalisation.scaling}
    if isinstance(network, RandomFeatureNetwork):
        arrays |= {field.name: getattr(network.reservoir, field.name) for field in fields(network.reservoir)}
    write_arrays(path, KIND, library.info, arrays)


def load_library(path: Path) -> MotionLibrary:
    """Reads and checks a library.

    Raises:
        FileFormatError: one line that names the file and what is wrong with it.
    """
    header, stored = read_arrays(path, KIND)
    info = _read_info(path, header)
    encoding = _joints(path, info) if info.encoding == JointAngles.name else _bones(path, info)
    network = _Reader(stored).network(info, encoding.channels)
    stored.finish()
    return MotionLibrary(info, network, encoding)


def _read_info(path: Path, tree: object) -> LibraryInfo:
    info = shaped(tree, LibraryInfo, f"{path} (header)")
    names = [motion.name for motion in info.motions]
    if not names or len(set(names)) < len(names):
        raise FileFormatError(f"{path}: its header names no motion, or one twice")
    if not (1.0 <= info.rate <= 1000.0 and 0.0 < info.leak <= 1.0):
        raise FileFormatError(f"{path}: rate {info.rate} Hz or leak {info.leak} is impossible")
    for motion in info.motions:
        if not (motion.name and motion.frames >= FEWEST_ANCHORS):
            raise FileFormatError(f"{path}: its header has a motion '{motion.name}' of {motion.frames} frames")
    return info


def _joints(path: Path, info: LibraryInfo) -> JointAngles:
    try:
        return JointAngles(JointBody.of(info.skeleton.bones))
    except FileFormatError as error:
        raise FileFormatError(f"{path}: {error}") from None


def _bones(path: Path, header: LibraryInfo) -> BoneDirections:
    info = header.skeleton
    try:
        skeleton = Skeleton(
            info.name,
            tuple(info.bones),
            np.array(info.parent, dtype=np.int64),
            np.array(info.rest_direction, dtype=np.float64),
            np.array(info.length, dtype=np.float64),
        )
    except (FileFormatError, ValueError, OverflowError) as error:
        raise FileFormatError(f"{path}: {error}") from None
    for hip in (info.right_hip, info.left_hip):
        if hip not in skeleton.bones:
            raise FileFormatError(f"{path}: hip bone '{hip}' is not in its skeleton")
    kind = JointRotations if header.encoding == JointRotations.name else BoneDirections
    return kind(skeleton, info.right_hip, info.left_hip)


class _Reader:
    """Makes a network of the arrays of a file."""

    def __init__(self, stored: StoredArrays) -> None:
        self.stored, self.path, self.size, self.take = stored, stored.path, stored.size, stored.take

    def network(self, info: LibraryInfo, channels: int) -> AnyNetwork:
        if info.network == "conceptor":
            parts = {motion.name: self.conceptor(motion.name, channels) for motion in info.motions}
            sizes = {len(part.bias) for part in parts.values()}
            if len(sizes) > 1:
                raise FileFormatError(f"{self.path}: motions of different reservoir sizes {sorted(sizes)}")
            memory = self.memory(len(parts), sizes.pop(), channels) if "memory/estimate" in self.stored else None
            network: AnyNetwork = ConceptorNetwork(parts, memory)
        elif info.network == "centralized":
            network = self.centralized(info, channels)
        elif info.network == "random-feature":
            network = self.random_features(info, channels)
        else:
            neurons = self.size("bias")
            network = EchoStateNetwork(
                self.take("weights", neurons, neurons),
                self.take("feedback", neurons, channels),
                self.take("bias", neurons),
                info.leak,
                self.normalisation("", channels),
                {motion.name: self.echo_state(motion.name, neurons, channels) for motion in info.motions},
                clipped=info.clipped,
            )
        return network

    def memory(self, motions: int, neurons: int, channels: int) -> Memory:
        return Memory(
            estimate=self.take("memory/estimate", channels, neurons),
            readout=self.take("memory/readout", channels, neurons),
            means=self.take("memory/means", motions, neurons),
            normalisation=self.normalisation("memory/", channels),
        )

    def normalisation(self, at: str, channels: int) -> Normalisation:
        shift, scaling = (self.take(at + name, channels, kind=np.float64) for name in ("shift", "scaling"))
        try:
            return Normalisation(shift, scaling)
        except MotiondeckError as error:
            raise FileFormatError(f"{self.path}: {error}") from None

    def conceptor(self, motion: str, channels: int) -> ConceptorMotion:
        at = f"motion/{motion}/"
        neurons, rank, anchors = self.size(at + "bias"), self.size(at + "offset"), self.anchors(at)
        return ConceptorMotion(
            recurrent=self.take(at + "recurrent", neurons, rank),
            bias=self.take(at + "bias", neurons),
            project=self.take(at + "project", rank, neurons),
            offset=self.take(at + "offset", rank),
            readout=self.take(at + "readout", channels, rank),
            rest=self.take(at + "rest", channels),
            states=self.take(at + "states", anchors, rank),
        )

    def echo_state(self, motion: str, neurons: int, channels: int) -> EchoStateMotion:
        at = f"motion/{motion}/"
        anchors = self.anchors(at)
        return EchoStateMotion(
            readout=self.take(at + "readout", channels, neurons),
            states=self.take(at + "states", anchors, neurons),
            outputs=self.take(at + "outputs", anchors, channels),
        )

    def random_features(self, info: LibraryInfo, channels: int) -> RandomFeatureNetwork:
        many, neurons = self.size("features"), self.size("features", 1)
        reservoir = FeatureReservoir(
            features=self.take("features", many, neurons),
            feedback=self.take("feedback", many, neurons),
            bias=self.take("bias", neurons),
            readout=self.take("readout", many, channels),
            rest=self.take("rest", channels),
        )
        motions = {}
        for motion in info.motions:
            at = f"motion/{motion.name}/"
            count, anchors = self.size(at + "uses"), self.anchors(at)
            uses = self.take(at + "uses", count, kind=np.int32)
            if not 0 <= uses.min() <= uses.max() < many:
                raise FileFormatError(f"{self.path}: '{at}uses' names a feature that is not among the {many}")
            motions[motion.name] = FeatureMotion(
                uses=uses,
                conception=self.take(at + "conception", count),
                offset=self.take(at + "offset", count),
                states=self.take(at + "states", anchors, count),
            )
        return RandomFeatureNetwork(reservoir, motions)

    def centralized(self, info: LibraryInfo, channels: int) -> CentralizedNetwork:
        motions = {}
        for motion in info.motions:
            at = f"motion/{motion.name}/"
            n, m = self.size(at + "frequency"), self.size(at + "sharpness")
            stored = StoredMotion(
                frequency=self.take(at + "frequency", n, kind=np.float64),
                phase=self.take(at + "phase", n, kind=np.float64),
                places=self.take(at + "places", m, 2 * n, kind=np.float64),
                sharpness=self.take(at + "sharpness", m, kind=np.float64),
                weights=self.take(at + "weights", channels, m, kind=np.float64),
                rest=self.take(at + "rest", channels, kind=np.float64),
            )
            try:
                motions[motion.name] = stored.revive(motion.frames, info.rate, loop=motion.plays == "loop")
            except MotiondeckError as error:
                raise FileFormatError(f"{self.path}: motion '{motion.name}': {error}") from None
        return CentralizedNetwork(motions, info.rate)

    def anchors(self, at: str) -> int:
        """How many stored states a motion has."""
        count = self.size(at + "states")
        if count < FEWEST_ANCHORS:
            raise FileFormatError(f"{self.path}: '{at}states' holds {count} anchors; {FEWEST_ANCHORS} are the fewest")
        return count
