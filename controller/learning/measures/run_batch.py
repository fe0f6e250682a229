"""Many runs of one motion side by side: a step of all of them is one product of matrices, not many of vectors.

The same equations as in the networks themselves (`networks/reservoirs/conceptor.py` and its neighbours), with places
for the thesis's two disturbances: of the first state (eq. 4.1) and of every state (eqs 4.2, 4.4).
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from controller.learning.measures.centralized_run_batch import CentralizedBatch
from controller.learning.measures.phase_run_batch import PhaseConceptorBatch, PhaseEchoStateBatch
from controller.networks.centralized.centralized_frames import CentralizedNetwork
from controller.networks.reservoirs.conceptor import ConceptorNetwork
from controller.networks.reservoirs.echo_state import EchoStateNetwork
from controller.networks.reservoirs.morph import ReservoirNetwork
from controller.networks.reservoirs.phase_conceptor import PhaseConceptorNetwork
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork
from controller.networks.reservoirs.random_feature_conceptor import RandomFeatureNetwork

Float32 = NDArray[np.float32]
Rows = NDArray[Any]


class RunBatch(Protocol):
    """R runs of one motion.

    Attributes:
        neurons: of the reservoir.
    """

    neurons: int

    def displace(self, noise: Float32) -> None:
        """Adds noise of shape (R, N) to the states before the first step."""
        ...

    def advance(self, noise: Float32 | None = None) -> Float32:
        """Steps every run one frame on, with noise (R, N) on the new state; frames of shape (R, C)."""
        ...


@runtime_checkable
class LosableBatch(RunBatch, Protocol):
    """Runs of a network that may lose its place in a motion, and that a guard then puts back."""

    def cue(self, rows: Rows, anchors: Rows) -> None:
        """Puts some of the runs into stored states."""
        ...

    def astray(self) -> NDArray[np.bool_]:
        """Which runs are in a state that undisturbed playing never reaches, shape (R,)."""
        ...


class ConceptorBatch:
    """R runs of one motion of a conceptor network.

    Args:
        network: what plays.
        motion: which motion; all runs start at its first anchor.
        runs: R.
        weights: W, shape (N, N), for displacements that do not lie in the k directions a library keeps. Without it
            only that part of a displacement counts which does.
    """

    def __init__(self, network: ConceptorNetwork, motion: str, runs: int, weights: Float32 | None = None) -> None:
        self.neurons = network.neurons
        self._net = network[motion]
        self._z = np.repeat(self._net.states[:1], runs, axis=0)
        self._weights = weights
        self._push: Float32 | None = None
        self._outside = np.zeros(runs, dtype=bool)

    def displace(self, noise: Float32) -> None:
        """x(0) = s + noise."""
        if self._weights is None:
            strength = np.linalg.norm(self._net.project, axis=1)
            self._z += noise @ (self._net.project / np.square(strength)[:, None]).T * strength
        else:
            self._push = noise @ self._weights.T
            self._outside = np.abs(noise).max(1) > 2.0

    def advance(self, noise: Float32 | None = None) -> Float32:
        """x(n+1) = m + C (tanh(W x(n) + b) + noise - m),  y(n+1) = W_out x(n+1)."""
        net = self._net
        hidden = self._z @ net.recurrent.T + net.bias
        if self._push is not None:
            hidden += self._push
            self._push = None
            self._outside[:] = False
        np.tanh(hidden, out=hidden)
        if noise is not None:
            hidden += noise
        self._z = hidden @ net.project.T - net.offset
        frames: Any = self._z @ net.readout.T + net.rest
        return frames

    def cue(self, rows: Rows, anchors: Rows) -> None:
        """Puts some of the runs into stored states."""
        self._z[rows] = self._net.states[anchors]
        self._outside[rows] = False
        if self._push is not None:
            self._push[rows] = 0.0

    def astray(self) -> NDArray[np.bool_]:
        """Where |z| is larger than in undisturbed playing, or some |x| is larger than 1 or NaN."""
        return ~(np.square(self._z).sum(1) <= self._net.reach**2) | self._outside


class EchoStateBatch:
    """R runs of one motion of an echo-state network.

    Args:
        network: what plays.
        motion: which motion; all runs start at its first anchor, x(0) = s and y(0) = o.
        runs: R.
    """

    def __init__(self, network: EchoStateNetwork, motion: str, runs: int) -> None:
        self.neurons = network.neurons
        self._net = network
        self._part = network[motion]
        self._x = np.repeat(self._part.states[:1], runs, axis=0)
        self._y = np.repeat(self._part.outputs[:1], runs, axis=0)

    def displace(self, noise: Float32) -> None:
        """x(0) = s + noise."""
        self._x += noise

    def advance(self, noise: Float32 | None = None) -> Float32:
        """x(n+1) = (1 - a) x(n) + a tanh(W x(n) + W_back y(n) + b) + noise,  y(n+1) = W_out x(n+1)."""
        net = self._net
        np.clip(self._x, -net.state_bound, net.state_bound, out=self._x)
        hidden = self._x @ net.weights.T
        hidden += self._y @ net.feedback.T
        hidden += net.bias
        np.tanh(hidden, out=hidden)
        hidden *= net.leak
        self._x *= 1.0 - net.leak
        self._x += hidden
        if noise is not None:
            self._x += noise
        self._y = np.clip(self._x @ self._part.readout.T, -net.output_bound, net.output_bound)
        return net.normalisation.invert(self._y.astype(np.float64)).astype(np.float32)

    def cue(self, rows: Rows, anchors: Rows) -> None:
        """Puts some of the runs into stored states and outputs."""
        self._x[rows] = self._part.states[anchors]
        self._y[rows] = self._part.outputs[anchors]

    def astray(self) -> NDArray[np.bool_]:
        """Where some |x| is larger than 1, as it never is in undisturbed playing."""
        return ~(np.abs(self._x).max(1) <= 1.0 + 1e-4)


class RandomFeatureBatch:
    """R runs of one motion of a random feature network.

    Args:
        network: what plays.
        motion: which motion; all runs start at its first anchor.
        runs: R.
    """

    def __init__(self, network: RandomFeatureNetwork, motion: str, runs: int) -> None:
        self.neurons = network.neurons
        self._part = network[motion]
        uses, self._shared = self._part.uses, network.reservoir
        self._features, self._feedback = self._shared.features[uses].T, self._shared.feedback[uses]
        self._readout = self._shared.readout[uses]
        self._z = np.repeat(self._part.states[:1], runs, axis=0)
        self._reach = 4.0 * np.square(self._part.states).sum(1).max()

    def displace(self, noise: Float32) -> None:
        """r(0) = s + noise, as far as the motion's features see it."""
        self._z += self._part.conception * (noise @ self._features)

    def advance(self, noise: Float32 | None = None) -> Float32:
        """r(n+1) = tanh(G z(n) + b) + noise,  z(n+1) = c F' r(n+1) + (1 - c) m,  y(n+1) = W_out z(n+1)."""
        hidden = np.tanh(self._z @ self._feedback + self._shared.bias)
        if noise is not None:
            hidden += noise
        self._z = self._part.conception * (hidden @ self._features) + self._part.offset
        frames: Any = self._z @ self._readout + self._shared.rest
        return frames

    def cue(self, rows: Rows, anchors: Rows) -> None:
        """Puts some of the runs into stored states."""
        self._z[rows] = self._part.states[anchors]

    def astray(self) -> NDArray[np.bool_]:
        """Where |z| is larger than in undisturbed playing."""
        return ~(np.square(self._z).sum(1) <= self._reach)


def batch_of(
    network: ReservoirNetwork | PhaseDrivenNetwork[Any] | CentralizedNetwork,
    motion: str,
    runs: int,
    weights: Float32 | None = None,
) -> RunBatch:
    """R runs of one motion of whichever network; see `ConceptorBatch` for the weights."""
    if isinstance(network, CentralizedNetwork):
        return CentralizedBatch(network, motion, runs)
    if isinstance(network, PhaseConceptorNetwork):
        return PhaseConceptorBatch(network[motion], runs)
    if isinstance(network, PhaseDrivenNetwork):
        return PhaseEchoStateBatch(network[motion], runs)
    if isinstance(network, ConceptorNetwork):
        return ConceptorBatch(network, motion, runs, weights)
    if isinstance(network, RandomFeatureNetwork):
        return RandomFeatureBatch(network, motion, runs)
    return EchoStateBatch(network, motion, runs)
