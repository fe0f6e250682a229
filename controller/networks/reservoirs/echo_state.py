"""An echo-state network with output feedback: one reservoir, one readout a motion (Deliallisi 2017, section 3.3).

    x(n+1) = (1 - a) x(n) + a tanh(W x(n) + W_back y(n) + b)        (eq. 3.4, teacher-forced with d(n) in training)
    y(n+1) = W_out,j x(n+1)                                         (eq. 3.6)

The state lies in [-1, 1] by construction and the normalised output was trained there, so both are clipped to it: a
disturbed network then finds its way back instead of feeding its own nonsense to itself.
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

OUTPUT_BOUND = 1.05


@dataclass(frozen=True)
class EchoStateMotion:
    """One motion in a reservoir of N neurons, with C channels and A anchors.

    Attributes:
        readout: W_out, shape (C, N).
        states: x at the anchors, shape (A, N).
        outputs: normalised y at the anchors, shape (A, C).
    """

    readout: Float32
    states: Float32
    outputs: Float32


class EchoStateNetwork(ReservoirNetwork[EchoStateMotion]):
    """Plays motions frame by frame; fits `base.FrameNetwork`.

    Args:
        weights: W, shape (N, N).
        feedback: W_back, shape (N, C).
        bias: b, shape (N,).
        leak: a in (0, 1].
        normalisation: between normalised channels and the encoding's units.
        motions: a readout and anchors for each.
        clipped: whether state and output are kept in the range of training (the thesis lets them go).

    Attributes:
        state_bound, output_bound: how large a number of x and of y may become.
    """

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
    ) -> None:
        super().__init__(motions, len(bias), feedback.shape[1])
        self.weights, self.feedback, self.bias, self.leak = weights, feedback, bias, leak
        self.normalisation = normalisation
        self.clipped = clipped
        self.state_bound, self.output_bound = (1.0, OUTPUT_BOUND) if clipped else (np.inf, np.inf)
        self._hidden = np.zeros(len(bias), dtype=np.float32)
        self._fed_back = np.zeros(len(bias), dtype=np.float32)
        # As arrays, because a step that is given plain numbers makes an array of each.
        self._highest_x, self._highest_y, self._leak, self._rest = (
            np.array(number, dtype=np.float32) for number in (self.state_bound, self.output_bound, leak, 1.0 - leak)
        )
        self._lowest_x, self._lowest_y = -self._highest_x, -self._highest_y
        self.cue(self.motions[0], 0)

    def with_motions(self, more: dict[str, EchoStateMotion]) -> EchoStateNetwork:
        """The same reservoir with further motions."""
        motions = self._of | more
        return EchoStateNetwork(
            self.weights, self.feedback, self.bias, self.leak, self.normalisation, motions, clipped=self.clipped
        )

    def anchors(self, motion: str) -> Channels:
        """The frames at the anchors of a motion, shape (anchors, channels)."""
        return self.normalisation.invert(self[motion].outputs.astype(np.float64))

    def recall(self, motion: str) -> Channels:
        """What the readout makes of the stored states, shape (anchors, channels); the anchors are what was taught."""
        part = self[motion]
        return self.normalisation.invert((part.states @ part.readout.T).astype(np.float64))

    def cue(self, motion: str, anchor: int) -> None:
        """Starts from the recorded state s and output o (section 3.3.3)."""
        self._playing = self[motion]
        self.activation = self._playing.states[anchor].copy()
        self._y = self._playing.outputs[anchor].copy()

    def advance(self, out: Channels) -> None:
        """Steps one frame on and writes it into out, shape (channels,)."""
        x, hidden = self.activation, self._hidden
        _keep_between(self._lowest_x, self._highest_x, x)
        np.dot(self.weights, x, out=hidden)
        np.dot(self.feedback, self._y, out=self._fed_back)
        np.add(hidden, self._fed_back, out=hidden)
        np.add(hidden, self.bias, out=hidden)
        np.tanh(hidden, out=hidden)
        np.multiply(hidden, self._leak, out=hidden)
        np.multiply(x, self._rest, out=x)
        np.add(x, hidden, out=x)
        np.dot(self._playing.readout, x, out=self._y)
        _keep_between(self._lowest_y, self._highest_y, self._y)
        np.copyto(out, self._y)
        self.normalisation.invert_in_place(out)

    def astray(self) -> bool:
        """Whether the state is one that no playing leads to: |x| is at most 1."""
        np.abs(self.activation, out=self._hidden)
        return not self._hidden.max() <= 1.0 + 1e-4

    def snapshot(self) -> tuple[EchoStateMotion, Float32, Float32]:
        """A copy of the state."""
        return self._playing, self.activation.copy(), self._y.copy()

    def restore(self, snapshot: Any) -> None:
        """Puts the state back to a snapshot."""
        self._playing, x, y = snapshot
        self.activation, self._y = x.copy(), y.copy()


def _keep_between(low: Float32, high: Float32, values: Float32) -> None:
    """Clips values where they are; `np.clip` goes by way of Python objects."""
    np.maximum(values, low, out=values)
    np.minimum(values, high, out=values)
