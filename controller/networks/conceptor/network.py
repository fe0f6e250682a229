"""Conceptors: one reservoir holds many motions, and a projection picks which of them it plays.

Playback is  x(n+1) = C_j tanh(W x(n) + b),  y(n) = W_out x(n)  (Deliallisi 2017, eqs 3.14, 3.15). Two changes make it
robust and fast:

- affine: a motion's states lie around a mean m_j, so C_j acts on the difference to it,

      x(n+1) = m_j + C_j (tanh(W x(n) + b) - m_j),

  which removes the mirror image -x, an attractor of a plain conceptor as well;
- low rank: C_j has few singular values that matter. With C_j ~ U S U' and x = m_j + U z, U of shape (N, k),

      z(n+1) = S U' tanh(W U z(n) + (W m_j + b)) - S U' m_j,      y(n) = W_out U z(n) + W_out m_j,

  a step costs 2 N k instead of 2 N^2 multiplications.

A mixture of two motions is  x(n+1) = (mu C_j + (1 - mu) C_i) tanh(W x(n) + b)  (eq. 3.16). An affine conceptor acts
about its own mean, so the means are mixed with the same shares; in k directions each,

    x(n) = (1 - mu) m_i + mu m_j + U_i z_i + U_j z_j,

and the mixture is played exactly, without the dense matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from controller.networks.base import AutonomousNetwork, Channels, Float32, ReservoirNetwork, Rows, require_playing
from controller.networks.storage import StoredNetwork

LARGEST_NOISE = 2.0  # beyond it |s + noise| > 1, which tanh never gives: |s| <= 1


@dataclass(frozen=True)
class ConceptorMotion:
    """One motion as playback needs it, of rank k in a reservoir of N neurons, with C channels and A anchors."""

    recurrent: Float32  # W U, shape (N, k)
    bias: Float32  # W m + b, shape (N,)
    project: Float32  # S U', shape (k, N)
    offset: Float32  # S U' m, shape (k,)
    readout: Float32  # W_out U in the units of the encoding, shape (C, k)
    rest: Float32  # W_out m in the units of the encoding, shape (C,)
    states: Float32  # z at the anchors, shape (A, k)


class ConceptorNetwork(ReservoirNetwork[ConceptorMotion]):
    """Plays the motions of one reservoir frame by frame; fits `base.AutonomousNetwork`."""

    kind = "conceptor"

    def __init__(self, motions: dict[str, ConceptorMotion], runs: tuple[int, ...] = ()) -> None:
        first = next(iter(motions.values()))
        super().__init__(motions, len(first.bias), len(first.rest), runs)
        # Twice the length of the longest stored state, squared: undisturbed playing stays below it.
        self._reach = {name: 4.0 * float(np.square(part.states).sum(1).max()) for name, part in motions.items()}
        self._push: Float32 | None = None  # within tanh in the next step
        self._outside: Any = False  # runs that a displacement took out of the range of tanh
        self.cue(self.motions[0], 0)

    def with_motions(self, more: dict[str, ConceptorMotion], runs: tuple[int, ...] = ()) -> ConceptorNetwork:
        return ConceptorNetwork(self._of | more, runs)

    @property
    def as_autonomous(self) -> AutonomousNetwork:
        return self

    def anchors(self, motion: str) -> Channels:
        net = self[motion]
        return (net.states @ net.readout.T + net.rest).astype(np.float64)

    def cue(self, motion: str, anchor: Any, rows: Rows = ...) -> None:
        part = self[motion]
        if rows is ...:
            self.start(part, self._reach[motion], part.states[anchor])
            return
        self._z[rows] = part.states[anchor]
        if self._push is not None:
            self._push[rows], self._outside[rows] = 0.0, False

    def start(self, part: ConceptorMotion, bound: float, state: Float32) -> None:
        """Plays a motion from a state on, which counts as astray where |z|^2 is above a bound."""
        self._playing, self._bound = part, bound
        self._z = np.broadcast_to(state, (*self.runs, state.shape[-1])).copy()
        self._recurrent, self._project, self._readout = part.recurrent.T, part.project.T, part.readout.T
        self._push, self._outside = None, False

    def advance(self, out: Channels, noise: Float32 | None = None) -> None:
        """x(n+1) = m + C (tanh(W x(n) + b) + noise - m),  y(n+1) = W_out x(n+1)."""
        net, z, hidden = self._playing, self._z, self.activation
        np.dot(z, self._recurrent, out=hidden)
        np.add(hidden, net.bias, out=hidden)
        if self._push is not None:
            hidden += self._push
            self._push, self._outside = None, False
        np.tanh(hidden, out=hidden)
        if noise is not None:
            hidden += noise
        np.dot(hidden, self._project, out=z)
        np.subtract(z, net.offset, out=z)
        np.dot(z, self._readout, out=self._frame)
        # Added and then copied: an addition that also converts allocates buffers.
        np.add(self._frame, net.rest, out=self._frame)
        np.copyto(out, self._frame)

    def displace(self, noise: Float32, weights: Float32 | None = None) -> None:
        """x(0) = s + noise; without W only the part in the k stored directions counts."""
        if weights is None:
            strength = np.linalg.norm(self._playing.project, axis=1)
            self._z += noise @ (self._playing.project / np.square(strength)[:, None]).T * strength
        else:
            self._push = noise @ weights.T
            self._outside = np.abs(noise).max(-1) > LARGEST_NOISE

    def astray(self) -> Any:
        """Whether |z| is larger than in undisturbed playing, or some |x| than tanh allows, or NaN."""
        z = self._z
        return ~((np.dot(z, z) if z.ndim == 1 else np.square(z).sum(1)) <= self._bound) | self._outside

    def snapshot(self) -> tuple[ConceptorMotion, float, Float32]:
        return self._playing, self._bound, self._z.copy()

    def restore(self, snapshot: Any) -> None:
        self.start(*snapshot)

    def morph(self, source: str, target: str) -> _ConceptorMorph:
        return _ConceptorMorph(self, source, target)

    @classmethod
    def load(cls, stored: StoredNetwork) -> Self:
        """The network that a file holds; all motions have one size of the reservoir."""
        motions: dict[str, ConceptorMotion] = {}
        neurons: set[int] = set()
        for motion in stored.header.motions:
            at = f"motion/{motion.name}/"
            sizes = {"a": stored.anchors(at), "c": stored.channels}
            found = stored.read(
                at, sizes, bias="n", offset="k", recurrent="nk", project="kn", readout="ck", rest="c", states="ak"
            )
            motions[motion.name] = ConceptorMotion(**found)
            neurons.add(sizes["n"])
        if len(neurons) > 1:
            raise stored.error(f"motions of different reservoir sizes {sorted(neurons)}")
        stored.stored.leave_out("memory/")  # what adding a motion needed, of libraries up to November 2026
        return cls(motions)


class _ConceptorMorph:
    """A morph; MotiondeckError if the network does not play the source."""

    def __init__(self, network: ConceptorNetwork, source: str, target: str) -> None:
        self._network, self._to, self._mu = network, target, 0.0
        self._source, self._target = network[source], network[target]
        playing, self._bound, self._z_source = network.snapshot()
        require_playing(playing is self._source, source)
        self._z_target = np.zeros(self._target.states.shape[1], dtype=np.float32)

    def settle(self) -> None:
        """Leaves the target playing; what lies outside of its directions is dropped, as at mu = 1."""
        self._network.cue(self._to, 0)
        playing, bound, _ = self._network.snapshot()
        self._network.restore((playing, bound, self._z_target.astype(np.float32)))

    def give_up(self) -> None:
        self._network.restore((self._source, self._bound, self._z_source.astype(np.float32)))

    def advance(self, mu: float, out: Channels) -> None:
        a, b = self._source, self._target
        # The state was mixed with the last mu, so its mean was, too.
        hidden = a.recurrent @ self._z_source + b.recurrent @ self._z_target
        hidden += (1.0 - self._mu) * a.bias + self._mu * b.bias
        np.tanh(hidden, out=hidden)
        self._z_source = (1.0 - mu) * (a.project @ hidden - a.offset)
        self._z_target = mu * (b.project @ hidden - b.offset)
        out[:] = a.readout @ self._z_source + b.readout @ self._z_target + (1.0 - mu) * a.rest + mu * b.rest
        self._mu = mu


KIND = ConceptorNetwork
