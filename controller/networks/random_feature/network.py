"""Random feature conceptors: a motion is one number a feature and not a matrix (Jaeger 2014, section 3.15).

The state r of N neurons is seen through M random features f_i, and each motion j lets so much of each of them through:

    z_i(n) = c_i f_i' r(n) + (1 - c_i) m_i,      r(n+1) = tanh(G z(n) + b),      y(n) = W_out z(n)

F, G and W_out are shared by all motions. A motion has its conception weights c, a diagonal conceptor on the features,
and their means m, about which it acts as the other conceptors do. It uses k of the M features and closes the others
(c_i = m_i = 0), so that it needs O(k) numbers and a step 2 N k multiplications.

A mixture of two motions mixes their conception weights (Deliallisi 2017, eqs 3.16, 3.17).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from controller.networks.base import Channels, lead_shape
from controller.networks.reservoirs.reservoir_network import DirectionMorph, DirectionReservoir, Float32
from controller.networks.storage import StoredNetwork, arrays_of

FeatureRows = tuple[Float32, Float32, Float32]  # of k features: F' (k, N), G' (k, N) and W_out' (k, C)


@dataclass(frozen=True)
class FeatureReservoir:
    """The weights that all motions share, with N neurons, M features and C channels."""

    features: Float32  # F', one feature a row, shape (M, N)
    feedback: Float32  # G', from each feature to the neurons, shape (M, N)
    bias: Float32  # b, shape (N,)
    readout: Float32  # W_out', in the units of the encoding, shape (M, C)
    rest: Float32  # the readout of z = 0, in the units of the encoding, shape (C,)


@dataclass(frozen=True)
class FeatureMotion:
    """One motion that uses k features, with A anchors."""

    uses: NDArray[np.int32]  # which features, rising, shape (k,)
    conception: Float32  # c of them, shape (k,)
    offset: Float32  # (1 - c) m, shape (k,)
    states: Float32  # z at the anchors, shape (A, k)


class RandomFeatureNetwork(DirectionReservoir[FeatureMotion]):
    """Plays the motions of one reservoir frame by frame; fits `base.AutonomousNetwork`."""

    kind = "random-feature"

    def __init__(
        self, reservoir: FeatureReservoir, motions: dict[str, FeatureMotion], runs: tuple[int, ...] = ()
    ) -> None:
        super().__init__(motions, len(reservoir.bias), len(reservoir.rest), runs)
        self.reservoir = reservoir
        # The rows that a motion uses, side by side: gathered at a cue, so that a step runs through memory in order.
        most = max(len(part.uses) for part in motions.values())
        # Those of a second motion, for a morph, are not touched before there is one.
        self._shared = reservoir.features, reservoir.feedback, reservoir.readout
        self._first, self._second = (
            tuple(np.zeros((most, shared.shape[1]), dtype=np.float32) for shared in self._shared) for _ in range(2)
        )
        self._gathered: FeatureMotion | None = None
        self.cue(self.motions[0], 0)

    def with_motions(self, more: dict[str, FeatureMotion], runs: int | None = None) -> RandomFeatureNetwork:
        return RandomFeatureNetwork(self.reservoir, self._of | more, lead_shape(runs))

    def anchors(self, motion: str) -> Channels:
        part = self[motion]
        frames = part.states @ self.reservoir.readout[part.uses] + self.reservoir.rest
        return frames.astype(np.float64)

    def advance(self, out: Channels, noise: Float32 | None = None) -> None:
        """r(n+1) = tanh(G z(n) + b) + noise,  z(n+1) = c F' r(n+1) + (1 - c) m,  y(n+1) = W_out z(n+1)."""
        z, hidden = self._z, self.activation
        np.dot(z, self._feedback, out=hidden)
        np.add(hidden, self.reservoir.bias, out=hidden)
        np.tanh(hidden, out=hidden)
        if noise is not None:
            hidden += noise
        np.dot(hidden, self._features.T, out=z)
        np.multiply(z, self._conception, out=z)
        np.add(z, self._offset, out=z)
        np.dot(z, self._readout, out=self._frame)
        # Added and then copied: an addition that also converts allocates buffers.
        np.add(self._frame, self.reservoir.rest, out=self._frame)
        np.copyto(out, self._frame)

    def displace(self, noise: Float32, weights: Float32 | None = None) -> None:
        """r(0) = s + noise, as far as the motion's features see it."""
        self._z += self._conception * (noise @ self._features.T)

    def rows_beside(self, motion: str) -> FeatureRows:
        """Those of a second motion, in the same memory at each call, so that a morph in a tick allocates none."""
        return self._gather(self[motion], self._second)

    def morph(self, source: str, target: str) -> _FeatureMorph:
        return _FeatureMorph(self, source, target)

    def start(self, part: FeatureMotion, bound: float, state: Float32) -> None:
        super().start(part, bound, state)
        if part is not self._gathered:
            self._gathered, self._conception, self._offset = part, part.conception, part.offset
            self._features, self._feedback, self._readout = self.rows = self._gather(part, self._first)

    def _gather(self, part: FeatureMotion, into: tuple[Float32, ...]) -> FeatureRows:
        features, feedback, readout = (rows[: len(part.uses)] for rows in into)
        for shared, rows in zip(self._shared, (features, feedback, readout), strict=True):
            # "clip" because numpy otherwise copies, to be able to undo an error.
            np.take(shared, part.uses, axis=0, out=rows, mode="clip")
        return features, feedback, readout

    def arrays(self) -> dict[str, NDArray[Any]]:
        return super().arrays() | arrays_of(self.reservoir, "")

    @classmethod
    def load(cls, stored: StoredNetwork) -> Self:
        sizes = {"c": stored.channels}
        reservoir = stored.read("", sizes, features="mn", feedback="mn", bias="n", readout="mc", rest="c")
        motions: dict[str, FeatureMotion] = {}
        for motion in stored.header.motions:
            at = f"motion/{motion.name}/"
            own = {"a": stored.anchors(at)}
            uses = stored.read(at, own, np.int32, uses="k")["uses"]
            if not 0 <= uses.min() <= uses.max() < sizes["m"]:
                raise stored.error(f"'{at}uses' names a feature that is not among the {sizes['m']}")
            motions[motion.name] = FeatureMotion(uses, **stored.read(at, own, conception="k", offset="k", states="ak"))
        return cls(FeatureReservoir(**reservoir), motions)


class _FeatureMorph(DirectionMorph[FeatureMotion]):
    def __init__(self, network: RandomFeatureNetwork, source: str, target: str) -> None:
        super().__init__(network, source, target)
        self._network = network
        # Views: the network plays the source and stands still meanwhile.
        self._rows_source, self._rows_target = network.rows, network.rows_beside(target)

    def advance(self, mu: float, out: Channels) -> None:
        a, b, shared = self._source, self._target, self._network.reservoir
        (features_a, feedback_a, readout_a), (features_b, feedback_b, readout_b) = self._rows_source, self._rows_target
        hidden = np.tanh(self._z_source @ feedback_a + self._z_target @ feedback_b + shared.bias)
        self._z_source = np.float32(1.0 - mu) * (a.conception * (features_a @ hidden) + a.offset)
        self._z_target = np.float32(mu) * (b.conception * (features_b @ hidden) + b.offset)
        out[:] = self._z_source @ readout_a + self._z_target @ readout_b + shared.rest


KIND = RandomFeatureNetwork
