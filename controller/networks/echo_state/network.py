"""An echo-state network with output feedback: one reservoir, one readout a motion (Deliallisi 2017, section 3.3).

    x(n+1) = (1 - a) x(n) + a tanh(W x(n) + W_back y(n) + b)        (eq. 3.4, teacher-forced with d(n) in training)
    y(n+1) = W_out,j x(n+1)                                         (eq. 3.6)

The state lies in [-1, 1] by construction and the normalised output was trained there, so both are clipped to it: a
disturbed network then finds its way back instead of feeding its own nonsense to itself.

A mixture of two motions mixes their readouts:  y(n) = (mu W_out,j + (1 - mu) W_out,i) x(n)  (eq. 3.7).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from controller.motion.encodings.normalisation import Normalisation
from controller.networks.base import AutonomousNetwork, Channels, Float32, ReservoirNetwork, Rows, require_playing
from controller.networks.storage import StoredNetwork, arrays_of

OUTPUT_BOUND = 1.05


@dataclass(frozen=True)
class EchoStateMotion:
    """One motion in a reservoir of N neurons, with C channels and A anchors."""

    readout: Float32  # W_out, shape (C, N)
    states: Float32  # x at the anchors, shape (A, N)
    outputs: Float32  # normalised y at the anchors, shape (A, C)


class EchoStateNetwork(ReservoirNetwork[EchoStateMotion]):
    """Plays motions frame by frame; fits `base.AutonomousNetwork`.

    `weights` are W, shape (N, N), `feedback` W_back, shape (N, C), `bias` b, shape (N,), `leak` a in (0, 1]. Where
    `clipped`, state and output are kept in the range of training (the thesis does not clip).
    """

    kind = "echo-state"

    def __init__(
        self,
        weights: Float32,
        feedback: Float32,
        bias: Float32,
        leak: float,
        normalisation: Normalisation,
        motions: dict[str, EchoStateMotion],
        *,
        clipped: bool = True,
        runs: tuple[int, ...] = (),
    ) -> None:
        super().__init__(motions, len(bias), feedback.shape[1], runs)
        self.weights, self.feedback, self.bias, self.leak = weights, feedback, bias, leak
        self.normalisation = normalisation
        self.clipped = clipped
        self._recurrent, self._back = weights.T, feedback.T
        self._hidden, self._fed_back = np.zeros_like(self.activation), np.zeros_like(self.activation)
        self._y = self._frame
        # As arrays, because a step that is given plain numbers makes an array of each.
        bounds = (1.0, OUTPUT_BOUND) if clipped else (np.inf, np.inf)
        self._highest_x, self._highest_y, self._leak, self._rest = (
            np.array(number, dtype=np.float32) for number in (*bounds, leak, 1.0 - leak)
        )
        self._lowest_x, self._lowest_y = -self._highest_x, -self._highest_y
        self.cue(self.motions[0], 0)

    def with_motions(self, more: dict[str, EchoStateMotion], runs: tuple[int, ...] = ()) -> EchoStateNetwork:
        shared = self.weights, self.feedback, self.bias, self.leak, self.normalisation
        return EchoStateNetwork(*shared, self._of | more, clipped=self.clipped, runs=runs)

    @property
    def as_autonomous(self) -> AutonomousNetwork:
        return self

    def anchors(self, motion: str) -> Channels:
        return self.normalisation.invert(self[motion].outputs.astype(np.float64))

    def recall(self, motion: str) -> Channels:
        """The readout at the stored states, shape (anchors, channels); the anchors are the taught outputs."""
        part = self[motion]
        return self.normalisation.invert((part.states @ part.readout.T).astype(np.float64))

    def cue(self, motion: str, anchor: Any, rows: Rows = ...) -> None:
        """Starts from the recorded state s and output o (section 3.3.3); of several runs, some, one anchor each."""
        self.play(self[motion])
        self.activation[rows] = self._playing.states[anchor]
        self._y[rows] = self._playing.outputs[anchor]

    def play(self, part: EchoStateMotion) -> None:
        """Goes on with another motion's readout from the present state."""
        self._playing, self._readout = part, part.readout.T

    def advance(self, out: Channels, noise: Float32 | None = None) -> None:
        """The equations above; noise is added to x(n+1)."""
        x, y, hidden = self.activation, self._y, self._hidden
        np.maximum(x, self._lowest_x, out=x)  # `np.clip` goes by way of Python objects
        np.minimum(x, self._highest_x, out=x)
        np.dot(x, self._recurrent, out=hidden)
        np.dot(y, self._back, out=self._fed_back)
        np.add(hidden, self._fed_back, out=hidden)
        np.add(hidden, self.bias, out=hidden)
        np.tanh(hidden, out=hidden)
        np.multiply(hidden, self._leak, out=hidden)
        np.multiply(x, self._rest, out=x)
        np.add(x, hidden, out=x)
        if noise is not None:
            x += noise
        np.dot(x, self._readout, out=y)
        np.maximum(y, self._lowest_y, out=y)
        np.minimum(y, self._highest_y, out=y)
        np.copyto(out, y)
        self.normalisation.invert_in_place(out)

    def displace(self, noise: Float32, weights: Float32 | None = None) -> None:
        self.activation += noise

    def astray(self) -> Any:
        """Whether some |x| is larger than 1, or NaN."""
        np.abs(self.activation, out=self._hidden)
        return ~(self._hidden.max(-1) <= 1.0 + 1e-4)

    def morph(self, source: str, target: str) -> _EchoStateMorph:
        return _EchoStateMorph(self, source, target)

    def snapshot(self) -> tuple[EchoStateMotion, Float32, Float32]:
        return self._playing, self.activation.copy(), self._y.copy()

    def restore(self, snapshot: Any) -> None:
        part, x, y = snapshot
        self.play(part)
        self.activation[...], self._y[...] = x, y

    def arrays(self) -> dict[str, NDArray[Any]]:
        shared = {"weights": self.weights, "feedback": self.feedback, "bias": self.bias}
        return super().arrays() | shared | arrays_of(self.normalisation, "")

    def header_fields(self) -> dict[str, Any]:
        return {"leak": self.leak, "clipped": self.clipped}

    @classmethod
    def load(cls, stored: StoredNetwork) -> Self:
        sizes, header = {"c": stored.channels}, stored.header
        shared = stored.read("", sizes, bias="n", weights="nn", feedback="nc")
        normalisation = stored.normalisation()
        motions: dict[str, EchoStateMotion] = {}
        for motion in header.motions:
            at = f"motion/{motion.name}/"
            own = sizes | {"a": stored.anchors(at)}
            motions[motion.name] = EchoStateMotion(**stored.read(at, own, readout="cn", states="an", outputs="ac"))
        weights = shared["weights"], shared["feedback"], shared["bias"]
        return cls(*weights, header.leak, normalisation, motions, clipped=header.clipped)


class _EchoStateMorph:
    def __init__(self, network: EchoStateNetwork, source: str, target: str) -> None:
        self._network = network
        self._source, self._target = network[source], network[target]
        require_playing(network.snapshot()[0] is self._source, source)

    def advance(self, mu: float, out: Channels) -> None:
        readout = np.float32(1.0 - mu) * self._source.readout + np.float32(mu) * self._target.readout
        self._network.play(
            EchoStateMotion(readout.astype(np.float32, copy=False), self._target.states, self._target.outputs)
        )
        self._network.advance(out)

    def settle(self) -> None:
        self._network.play(self._target)

    def give_up(self) -> None:
        self._network.play(self._source)


KIND = EchoStateNetwork
