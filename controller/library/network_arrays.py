"""The weights of each kind of network as named arrays, and back."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.library.library_header import FEWEST_ANCHORS, LibraryInfo, MotionInfo
from controller.motion.encodings.normalisation import Normalisation
from controller.networks.centralized.centralized import CentralizedMotion
from controller.networks.centralized.centralized_frames import CentralizedNetwork, StoredMotion
from controller.networks.centralized.low_rank import LowRankWeights, PackedWeights
from controller.networks.reservoirs.conceptor import ConceptorMotion, ConceptorNetwork, Memory
from controller.networks.reservoirs.echo_state import EchoStateMotion, EchoStateNetwork
from controller.networks.reservoirs.phase_conceptor import PhaseConceptorMotion, PhaseConceptorNetwork, StoredPieces
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork, PhaseMotion
from controller.networks.reservoirs.phase_echo_state import (
    PhaseEchoStateMotion,
    PhaseEchoStateNetwork,
    StoredReadouts,
)
from controller.networks.reservoirs.phase_reservoir import PhaseCourse, PhaseReservoir, PhaseScales
from controller.networks.reservoirs.random_feature_conceptor import (
    FeatureMotion,
    FeatureReservoir,
    RandomFeatureNetwork,
)
from motiondeck_base.arrays_file import StoredArrays
from motiondeck_base.errors import FileFormatError, MotiondeckError

Network = ConceptorNetwork | EchoStateNetwork | RandomFeatureNetwork
PhaseDriven = PhaseDrivenNetwork[Any]
AnyNetwork = Network | PhaseDriven | CentralizedNetwork


def arrays_of(network: AnyNetwork) -> dict[str, NDArray[Any]]:
    """Everything that is stored of a network, by name."""
    arrays: dict[str, NDArray[Any]] = {}
    for motion in network.motions:
        part = network[motion]
        if isinstance(part, PhaseMotion):
            arrays[f"motion/{motion}/held"] = np.array([part.course.held], dtype=np.int32)
            part = part.stored
        elif isinstance(part, CentralizedMotion):
            part = StoredMotion.of(part)
        for field in fields(part):
            value = getattr(part, field.name)
            if isinstance(value, LowRankWeights):
                packed = PackedWeights.of(value)
                arrays |= {f"motion/{motion}/{each.name}": getattr(packed, each.name) for each in fields(packed)}
            else:
                arrays[f"motion/{motion}/{field.name}"] = value
    if isinstance(network, ConceptorNetwork) and network.memory is not None:
        memory, normalisation = network.memory, network.memory.normalisation
        arrays |= {f"memory/{name}": getattr(memory, name) for name in ("estimate", "readout", "means")}
        arrays |= {"memory/shift": normalisation.shift, "memory/scaling": normalisation.scaling}
    if isinstance(network, EchoStateNetwork):
        arrays |= {"weights": network.weights, "feedback": network.feedback, "bias": network.bias}
    if isinstance(network, EchoStateNetwork | PhaseDrivenNetwork):
        arrays |= {"shift": network.normalisation.shift, "scaling": network.normalisation.scaling}
    if isinstance(network, RandomFeatureNetwork):
        arrays |= {field.name: getattr(network.reservoir, field.name) for field in fields(network.reservoir)}
    return arrays


def network_in(stored: StoredArrays, info: LibraryInfo, channels: int) -> AnyNetwork:
    """The network whose arrays a library file holds.

    Raises:
        FileFormatError: if an array is missing, is left over, or has another shape or type.
    """
    network = _Reader(stored).network(info, channels)
    stored.finish()
    return network


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
        elif info.network in ("phase-conceptor", "phase-echo-state"):
            network = self.phase_driven(info, channels)
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

    def phase_driven(self, info: LibraryInfo, channels: int) -> PhaseDriven:
        scales, normalisation = self.scales(info), self.normalisation("", channels)
        reservoir = PhaseReservoir.draw(scales, channels, info.seed)
        if info.network == "phase-echo-state":
            echoes: dict[str, PhaseEchoStateMotion] = {}
            for motion in info.motions:
                read = self.readouts(motion, channels, scales.neurons)
                course = self.course(motion, len(read.readout))
                echoes[motion.name] = PhaseEchoStateMotion(read, course, reservoir, motion.input)
            return PhaseEchoStateNetwork(scales, info.seed, normalisation, echoes)
        motions: dict[str, PhaseConceptorMotion] = {}
        rank = self.size(f"motion/{info.motions[0].name}/directions", 2)
        for motion in info.motions:
            pieces = self.pieces(motion, channels, scales.neurons, rank)
            course = self.course(motion, len(pieces.mean))
            motions[motion.name] = PhaseConceptorMotion(pieces, course, reservoir, motion.input)
        return PhaseConceptorNetwork(scales, info.seed, normalisation, motions)

    def pieces(self, motion: MotionInfo, channels: int, neurons: int, rank: int) -> StoredPieces:
        """A motion of phase-driven conceptors."""
        at = f"motion/{motion.name}/"
        pieces, there = self.size(at + "directions"), self.size(at + "directions", 1)
        if there != neurons:
            raise FileFormatError(f"{self.path}: {neurons} neurons in its header, {there} in '{at}directions'")
        return StoredPieces(
            directions=self.take(at + "directions", pieces, neurons, rank, kind=np.float16),
            strength=self.take(at + "strength", pieces, rank),
            mean=self.take(at + "mean", pieces, neurons, kind=np.float16),
            estimate=self.take(at + "estimate", pieces, channels, rank + 1, kind=np.float16),
            readout=self.take(at + "readout", pieces, channels, rank + 1),
        )

    def readouts(self, motion: MotionInfo, channels: int, neurons: int) -> StoredReadouts:
        """A motion of a phase-driven echo-state network."""
        at = f"motion/{motion.name}/readout"
        return StoredReadouts(self.take(at, self.size(at), channels, neurons + 1))

    def scales(self, info: LibraryInfo) -> PhaseScales:
        """What the weights that phase-driven motions share are drawn with."""
        if info.scales is None:
            raise FileFormatError(f"{self.path}: its header has no scales for the weights that its motions share")
        return info.scales

    def course(self, motion: MotionInfo, pieces: int) -> PhaseCourse:
        """How the center turns with a motion of so many pieces."""
        at = f"motion/{motion.name}/"
        held = int(self.take(at + "held", 1, kind=np.int32)[0])
        if not 0 <= held < motion.frames or pieces > motion.frames:
            raise FileFormatError(
                f"{self.path}: '{at}': {pieces} pieces, {held} frames held, of {motion.frames} frames"
            )
        return PhaseCourse.of(motion.frames, pieces, loop=motion.plays == "loop", held=held)

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
                weights=self.centralized_weights(at, channels, m),
                rest=self.take(at + "rest", channels, kind=np.float64),
            )
            try:
                motions[motion.name] = stored.revive(motion.frames, info.rate, loop=motion.plays == "loop")
            except MotiondeckError as error:
                raise FileFormatError(f"{self.path}: motion '{motion.name}': {error}") from None
        return CentralizedNetwork(motions, info.rate)

    def centralized_weights(self, at: str, channels: int, satellites: int) -> NDArray[np.float64] | LowRankWeights:
        if at + "nonzero" not in self.stored:
            return self.take(at + "weights", channels, satellites, kind=np.float64)
        packed = PackedWeights(
            nonzero=self.take(at + "nonzero", self.size(at + "nonzero"), kind=np.uint8),
            shares=self.take(at + "shares", self.size(at + "shares")),
            used=self.take(at + "used", self.size(at + "used"), kind=np.int32),
            curves=self.take(at + "curves", self.size(at + "curves")),
        )
        try:
            return packed.unpack(channels, satellites)
        except MotiondeckError as error:
            raise FileFormatError(f"{self.path}: '{at}': {error}") from None

    def anchors(self, at: str) -> int:
        """How many stored states a motion has."""
        count = self.size(at + "states")
        if count < FEWEST_ANCHORS:
            raise FileFormatError(f"{self.path}: '{at}states' holds {count} anchors; {FEWEST_ANCHORS} are the fewest")
        return count
