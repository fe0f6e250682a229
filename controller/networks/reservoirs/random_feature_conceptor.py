"""Random feature conceptors: a motion is one number a feature and not a matrix (Jaeger 2014, section 3.15).

The state r of N neurons is seen through M random features f_i, and each motion j lets so much of each of them through:

    z_i(n) = c_i f_i' r(n) + (1 - c_i) m_i,      r(n+1) = tanh(G z(n) + b),      y(n) = W_out z(n)

F, G and W_out are shared by all motions. Of its own a motion has the conception weights c, which are a diagonal
conceptor on the features, and their means m, about which it acts as our other conceptors do. It uses k of the M
features and closes the others (c_i = m_i = 0), so that it needs O(k) numbers and a step 2 N k multiplications.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.networks.base import Channels
from controller.networks.reservoirs.reservoir_network import ReservoirNetwork

Float32 = NDArray[np.float32]

Rows = tuple[Float32, Float32, Float32]
"""Of k features: F' (k, N), G' (k, N) and W_out' (k, C)."""


@dataclass(frozen=True)
class FeatureReservoir:
    """What all motions share, with N neurons, M features and C channels.

    Attributes:
        features: F', one feature a row, shape (M, N).
        feedback: G', from each feature to the neurons, shape (M, N).
        bias: b, shape (N,).
        readout: W_out', in the units of the encoding, shape (M, C).
        rest: what is read from no feature at all, in the units of the encoding, shape (C,).
    """

    features: Float32
    feedback: Float32
    bias: Float32
    readout: Float32
    rest: Float32


@dataclass(frozen=True)
class FeatureMotion:
    """One motion that uses k features, with A anchors.

    Attributes:
        uses: which features, rising, shape (k,).
        conception: c of them, shape (k,).
        offset: (1 - c) m, shape (k,).
        states: z at the anchors, shape (A, k).
    """

    uses: NDArray[np.int32]
    conception: Float32
    offset: Float32
    states: Float32


class RandomFeatureNetwork(ReservoirNetwork[FeatureMotion]):
    """Plays the motions of one reservoir frame by frame; fits `base.FrameNetwork`.

    Args:
        reservoir: what they share.
        motions: what it plays.
    """

    def __init__(self, reservoir: FeatureReservoir, motions: dict[str, FeatureMotion]) -> None:
        super().__init__(motions, len(reservoir.bias), len(reservoir.rest))
        self.reservoir = reservoir
        self._reach = {name: 4.0 * float(np.square(part.states).sum(1).max()) for name, part in motions.items()}
        # The rows that a motion uses, side by side: gathered at a cue, so that a step runs through memory in order.
        most = max(len(part.uses) for part in motions.values())
        # Those of a second motion, for a morph, are not touched before there is one.
        self._shared = reservoir.features, reservoir.feedback, reservoir.readout
        self._open, self._beside = (
            tuple(np.zeros((most, shared.shape[1]), dtype=np.float32) for shared in self._shared) for _ in range(2)
        )
        self._playing: FeatureMotion | None = None
        self.cue(self.motions[0], 0)

    def with_motions(self, more: dict[str, FeatureMotion]) -> RandomFeatureNetwork:
        """The same reservoir with further motions."""
        return RandomFeatureNetwork(self.reservoir, self._of | more)

    def anchors(self, motion: str) -> Channels:
        """The frames at the anchors of a motion, shape (anchors, channels)."""
        part = self[motion]
        frames = part.states @ self.reservoir.readout[part.uses] + self.reservoir.rest
        return frames.astype(np.float64)

    def cue(self, motion: str, anchor: int) -> None:
        """Puts the network into the stored state of an anchor."""
        self._play(self[motion], self._reach[motion])
        self._z = self[motion].states[anchor].copy()

    def advance(self, out: Channels) -> None:
        """Steps one frame on and writes it into out, shape (channels,)."""
        z, hidden = self._z, self.activation
        np.dot(z, self._feedback, out=hidden)
        np.add(hidden, self.reservoir.bias, out=hidden)
        np.tanh(hidden, out=hidden)
        np.dot(self._features, hidden, out=z)
        np.multiply(z, self._conception, out=z)
        np.add(z, self._offset, out=z)
        np.dot(z, self._readout, out=self._frame)
        # Added and then copied: an addition that also converts makes buffers of its own.
        np.add(self._frame, self.reservoir.rest, out=self._frame)
        np.copyto(out, self._frame)

    def rows(self) -> Rows:
        """The features, the feedback and the readout that the playing motion uses; good until another is cued."""
        return self._features, self._feedback, self._readout

    def rows_beside(self, motion: str) -> Rows:
        """Those of a second motion, in the same memory at each call, so that a morph in a tick asks for none."""
        return self._gather(self[motion], self._beside)

    def astray(self) -> bool:
        """Whether the state is one that no playing leads to."""
        return not np.dot(self._z, self._z) <= self._bound

    def snapshot(self) -> tuple[FeatureMotion, float, Float32]:
        """A copy of the state."""
        assert self._playing is not None
        return self._playing, self._bound, self._z.copy()

    def restore(self, snapshot: Any) -> None:
        """Puts the state back to a snapshot."""
        part, bound, z = snapshot
        self._play(part, bound)
        self._z = z.copy()

    def _play(self, part: FeatureMotion, bound: float) -> None:
        self._bound = bound
        if part is self._playing:
            return
        self._playing, self._conception, self._offset = part, part.conception, part.offset
        self._features, self._feedback, self._readout = self._gather(part, self._open)

    def _gather(self, part: FeatureMotion, into: tuple[Float32, ...]) -> Rows:
        features, feedback, readout = (rows[: len(part.uses)] for rows in into)
        for shared, rows in zip(self._shared, (features, feedback, readout), strict=True):
            # "clip" because numpy makes a copy of its own to be able to take an error back.
            np.take(shared, part.uses, axis=0, out=rows, mode="clip")
        return features, feedback, readout
