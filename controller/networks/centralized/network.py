"""A centralized network frame by frame, entered at anchors."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from controller.networks.base import Activation, Channels, Network, lead_shape
from controller.networks.centralized.centralized import CentersPlayer, CentralizedMotion, shared_channels
from controller.networks.centralized.low_rank import LowRankWeights, PackedWeights
from controller.networks.centralized.satellites import GaussianSatellites
from controller.networks.centralized.switching_design import design_module
from controller.networks.storage import StoredNetwork, arrays_of
from motiondeck_base.errors import FileFormatError

ANCHOR_EVERY = 2


class CentralizedNetwork(Network[CentralizedMotion]):
    """Plays centralized motions frame by frame; SwitchingModuleError if they are too many for a switching module."""

    kind, by_module = "centralized", True

    def __init__(self, motions: dict[str, CentralizedMotion], rate: float, runs: tuple[int, ...] = ()) -> None:
        self.channels = shared_channels(motions)
        super().__init__(motions)
        self.rate, self.runs = rate, runs
        self.neurons = sum(len(part.frequency) + len(part.satellites) for part in motions.values())
        design_module(len(motions))  # here, as in a tick it would be late
        self.cue(self.motions[0], 0)

    def twin(self, runs: int | None = None) -> CentralizedNetwork:
        return CentralizedNetwork(self._of, self.rate, lead_shape(runs))

    def joined(self, other: CentralizedNetwork) -> CentralizedNetwork:
        return CentralizedNetwork(self._of | other._of, self.rate)

    def anchors(self, motion: str) -> Channels:
        return self[motion].at(self._anchor_times(motion))

    def _anchor_times(self, motion: str) -> Array:
        part = self[motion]
        frames = round(part.seconds * self.rate) + (not part.loop)
        return np.arange(0, frames, ANCHOR_EVERY) / self.rate

    def cue(self, motion: str, anchor: int) -> None:
        self._player = CentersPlayer(self[motion], anchor * ANCHOR_EVERY / self.rate, self.runs)

    def advance(self, out: Channels, noise: Activation | None = None) -> None:
        self._player.advance(1.0 / self.rate, noise)
        self._player.read(out)

    def noise_size(self, motion: str) -> int:
        """(q, p / omega) of each center; satellites follow at once."""
        return 2 * len(self[motion].frequency)

    def displace(self, noise: Activation, weights: Activation | None = None) -> None:
        self._player.displace(noise)

    def snapshot(self) -> CentersPlayer:
        return self._player.copy()

    def restore(self, snapshot: Any) -> None:
        self._player = snapshot.copy()

    def center_phases(self, motion: str) -> Array:
        part = self[motion]
        return part.phase + np.array([[0.0], [part.seconds]]) * part.frequency

    def sizes(self, motion: str) -> dict[str, float]:
        part = self[motion]
        counts = {"centers": len(part.frequency), "satellites": len(part.satellites)}
        return {**counts, "largest_weight": part.largest_weight}

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The stored arrays by name; weights of low rank without their zeros."""
        found: dict[str, NDArray[Any]] = {}
        for name in self.motions:
            part, at = self[name], f"motion/{name}/"
            own = {"frequency": part.frequency, "phase": part.phase, "rest": part.rest}
            own |= {"places": part.satellites.places, "sharpness": part.satellites.sharpness}
            if isinstance(part.weights, LowRankWeights):
                found |= arrays_of(PackedWeights.of(part.weights), at)
            else:
                own["weights"] = part.weights
            found |= {at + key: array for key, array in own.items()}
        return found

    @classmethod
    def load(cls, stored: StoredNetwork) -> Self:
        header, motions = stored.header, dict[str, CentralizedMotion]()
        for motion in header.motions:
            at, sizes, loop = f"motion/{motion.name}/", {"c": stored.channels}, motion.plays == "loop"
            sizes |= {"n": stored.stored.size(at + "frequency"), "m": stored.stored.size(at + "sharpness")}
            sizes["d"] = 2 * sizes["n"]
            placed = stored.read(at, sizes, np.float64, places="md", sharpness="m")
            found = stored.read(at, sizes, np.float64, frequency="n", phase="n", rest="c")
            weights = _stored_weights(stored, at, sizes)
            seconds = (motion.frames if loop else max(1, motion.frames - 1)) / header.rate
            with FileFormatError.placed(f"{stored.stored.path}: motion '{motion.name}'"):
                satellites = GaussianSatellites(**placed)
                part = CentralizedMotion(satellites=satellites, weights=weights, seconds=seconds, loop=loop, **found)
            motions[motion.name] = part
        return cls(motions, header.rate)


def _stored_weights(stored: StoredNetwork, at: str, sizes: dict[str, int]) -> Array | LowRankWeights:
    if at + "nonzero" not in stored.stored:
        return stored.read(at, sizes, np.float64, weights="cm")["weights"]
    own: dict[str, int] = {}
    flags, used = stored.read(at, own, np.uint8, nonzero="b"), stored.read(at, own, np.int32, used="r")
    packed = PackedWeights(**flags, **used, **stored.read(at, own, shares="s", curves="v"))
    with FileFormatError.placed(f"{stored.stored.path}: '{at}'"):
        return packed.unpack(sizes["c"], sizes["m"])


KIND = CentralizedNetwork
