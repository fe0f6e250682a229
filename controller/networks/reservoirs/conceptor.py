"""Conceptors: one reservoir holds many motions, and a projection picks which of them it plays.

Playback is  x(n+1) = C_j tanh(W x(n) + b),  y(n) = W_out x(n)  (Deliallisi 2017, eqs 3.14, 3.15). Two changes make it
robust and fast:

- affine: a motion's states lie around a mean m_j, so C_j acts on the difference to it,

      x(n+1) = m_j + C_j (tanh(W x(n) + b) - m_j),

  which takes away the mirror image -x that a plain conceptor is just as fond of;
- low rank: C_j has few singular values that matter. With C_j ~ U S U' and x = m_j + U z, U of shape (N, k),

      z(n+1) = S U' tanh(W U z(n) + (W m_j + b)) - S U' m_j,      y(n) = W_out U z(n) + W_out m_j,

  a step costs 2 N k instead of 2 N^2 multiplications.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.motion.encodings.normalisation import Normalisation
from controller.networks.base import Channels
from controller.networks.reservoirs.reservoir_network import ReservoirNetwork

Float32 = NDArray[np.float32]


@dataclass(frozen=True)
class ConceptorMotion:
    """One motion as playback needs it, of rank k in a reservoir of N neurons, with C channels and A anchors.

    Attributes:
        recurrent: W U, shape (N, k).
        bias: W m + b, shape (N,).
        project: S U', shape (k, N).
        offset: S U' m, shape (k,).
        readout: W_out U in the units of the encoding, shape (C, k).
        rest: W_out m in the units of the encoding, shape (C,).
        states: z at the anchors, shape (A, k).
    """

    recurrent: Float32
    bias: Float32
    project: Float32
    offset: Float32
    readout: Float32
    rest: Float32
    states: Float32

    @property
    def reach(self) -> float:
        """The largest |z| that playing leads to, with room to spare."""
        return 2.0 * float(np.sqrt(np.square(self.states).sum(1).max()))


@dataclass(frozen=True)
class Memory:
    """What a reservoir of N neurons learned for all of its P motions together.

    Playing does not need it, adding a motion does (`learning/reservoirs/incremental_loading.py`).

    Attributes:
        estimate: V, shape (C, N): which input the network expects by its state.
        readout: W_out, shape (C, N).
        means: m of each motion, shape (P, N).
        normalisation: between the channels of both and the encoding's units.
    """

    estimate: Float32
    readout: Float32
    means: Float32
    normalisation: Normalisation


class ConceptorNetwork(ReservoirNetwork[ConceptorMotion]):
    """Plays the motions of one reservoir frame by frame; fits `base.FrameNetwork`.

    Args:
        motions: what it plays.
        memory: what adding a motion needs, if that was kept.
    """

    def __init__(self, motions: dict[str, ConceptorMotion], memory: Memory | None = None) -> None:
        first = next(iter(motions.values()))
        super().__init__(motions, len(first.bias), len(first.rest))
        self.memory = memory
        self._reach = {name: part.reach for name, part in motions.items()}
        self._playing, self._bound = first, self._reach[self.motions[0]]
        self._z = first.states[0].copy()

    def with_motions(self, more: dict[str, ConceptorMotion]) -> ConceptorNetwork:
        """The same reservoir with further motions."""
        return ConceptorNetwork(self._of | more, self.memory)

    def anchors(self, motion: str) -> Channels:
        """The frames at the anchors of a motion, shape (anchors, channels)."""
        net = self[motion]
        return (net.states @ net.readout.T + net.rest).astype(np.float64)

    def cue(self, motion: str, anchor: int) -> None:
        """Puts the network into the stored state of an anchor."""
        self._playing, self._bound = self[motion], self._reach[motion]
        self._z = self._playing.states[anchor].copy()

    def advance(self, out: Channels) -> None:
        """Steps one frame on and writes it into out, shape (channels,)."""
        net, z, hidden = self._playing, self._z, self.activation
        np.dot(net.recurrent, z, out=hidden)
        np.add(hidden, net.bias, out=hidden)
        np.tanh(hidden, out=hidden)
        np.dot(net.project, hidden, out=z)
        np.subtract(z, net.offset, out=z)
        np.dot(net.readout, z, out=self._frame)
        # Added and then copied: an addition that also converts makes buffers of its own.
        np.add(self._frame, net.rest, out=self._frame)
        np.copyto(out, self._frame)

    def astray(self) -> bool:
        """Whether the state is one that no playing leads to."""
        return not np.dot(self._z, self._z) <= self._bound**2

    def snapshot(self) -> tuple[ConceptorMotion, float, Float32]:
        """A copy of the state."""
        return self._playing, self._bound, self._z.copy()

    def restore(self, snapshot: Any) -> None:
        """Puts the state back to a snapshot."""
        self._playing, self._bound, z = snapshot
        self._z = z.copy()
