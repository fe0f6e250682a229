"""Morphing: one network plays a mixture of two of its motions (Deliallisi 2017, eqs 3.7, 3.16 and 3.17).

    echo state:  y(n) = (mu W_out,j + (1 - mu) W_out,i) x(n)
    conceptor:   x(n+1) = (mu C_j + (1 - mu) C_i) tanh(W x(n) + b),      y(n) = W_out x(n)

mu = 0 is the source i, mu = 1 the target j, between them lies interpolation and beyond them extrapolation. An affine
conceptor acts about its own mean, so there the means are mixed with the same shares; in k directions each,

    x(n) = (1 - mu) m_i + mu m_j + U_i z_i + U_j z_j,

and the mixture is played exactly: nothing of the dense matrices is needed. Conception weights, which are a diagonal
conceptor on random features, are mixed alike.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from controller.networks.base import Channels
from controller.networks.reservoirs.conceptor import ConceptorNetwork
from controller.networks.reservoirs.echo_state import EchoStateMotion, EchoStateNetwork
from controller.networks.reservoirs.random_feature_conceptor import RandomFeatureNetwork
from motiondeck_base.errors import MotiondeckError

ReservoirNetwork = ConceptorNetwork | EchoStateNetwork | RandomFeatureNetwork


class Morph(Protocol):
    """A network that goes over from one motion to another."""

    def advance(self, mu: float, out: Channels) -> None:
        """Steps one frame on with the share mu of the target and writes it into out, shape (channels,)."""
        ...

    def settle(self) -> None:
        """Leaves the network playing the target alone, from where the mixture is."""
        ...

    def give_up(self) -> None:
        """Leaves it playing the source alone."""
        ...


def morph(network: ReservoirNetwork, source: str, target: str) -> Morph:
    """A morph that starts where a network is in the motion it plays.

    Raises:
        MotiondeckError: if the network does not play the source.
        UnknownNameError: if there is no such motion.
    """
    if isinstance(network, ConceptorNetwork):
        return _ConceptorMorph(network, source, target)
    if isinstance(network, RandomFeatureNetwork):
        return _FeatureMorph(network, source, target)
    return _EchoStateMorph(network, source, target)


class _ConceptorMorph:
    def __init__(self, network: ConceptorNetwork, source: str, target: str) -> None:
        self._network = network
        self._source, self._target, self._to = network[source], network[target], target
        playing, self._bound, self._z_source = network.snapshot()
        _check(playing is self._source, source)
        self._z_target = np.zeros_like(self._target.offset)
        self._mu = 0.0

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

    def settle(self) -> None:
        # What is left outside of the target's directions is given up, as at mu = 1.
        self._network.cue(self._to, 0)
        playing, bound, _ = self._network.snapshot()
        self._network.restore((playing, bound, self._z_target.astype(np.float32)))

    def give_up(self) -> None:
        self._network.restore((self._source, self._bound, self._z_source.astype(np.float32)))


class _FeatureMorph:
    def __init__(self, network: RandomFeatureNetwork, source: str, target: str) -> None:
        self._network = network
        self._source, self._target, self._to = network[source], network[target], target
        playing, self._bound, self._z_source = network.snapshot()
        _check(playing is self._source, source)
        self._z_target = np.zeros_like(self._target.offset)
        # Views: the network plays the source and stands still meanwhile.
        self._rows_source, self._rows_target = network.rows(), network.rows_beside(target)

    def advance(self, mu: float, out: Channels) -> None:
        a, b, shared = self._source, self._target, self._network.reservoir
        (features_a, feedback_a, readout_a), (features_b, feedback_b, readout_b) = self._rows_source, self._rows_target
        hidden = np.tanh(self._z_source @ feedback_a + self._z_target @ feedback_b + shared.bias)
        self._z_source = np.float32(1.0 - mu) * (a.conception * (features_a @ hidden) + a.offset)
        self._z_target = np.float32(mu) * (b.conception * (features_b @ hidden) + b.offset)
        out[:] = self._z_source @ readout_a + self._z_target @ readout_b + shared.rest

    def settle(self) -> None:
        self._network.cue(self._to, 0)
        playing, bound, _ = self._network.snapshot()
        self._network.restore((playing, bound, self._z_target))

    def give_up(self) -> None:
        self._network.restore((self._source, self._bound, self._z_source))


class _EchoStateMorph:
    def __init__(self, network: EchoStateNetwork, source: str, target: str) -> None:
        self._network = network
        self._source, self._target = network[source], network[target]
        _check(network.snapshot()[0] is self._source, source)

    def advance(self, mu: float, out: Channels) -> None:
        readout = np.float32(1.0 - mu) * self._source.readout + np.float32(mu) * self._target.readout
        self._play(EchoStateMotion(readout.astype(np.float32, copy=False), self._target.states, self._target.outputs))
        self._network.advance(out)

    def settle(self) -> None:
        self._play(self._target)

    def give_up(self) -> None:
        self._play(self._source)

    def _play(self, part: EchoStateMotion) -> None:
        _, x, y = self._network.snapshot()
        self._network.restore((part, x, y))


def _check(plays: bool, source: str) -> None:
    if not plays:
        raise MotiondeckError(f"a morph from '{source}' needs a network that plays '{source}'; cue it first")
