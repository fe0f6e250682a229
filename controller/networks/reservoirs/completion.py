"""Reconstructs unmeasured channels: an echo-state network that a measured signal drives.

    s(n) = (u(n) - m) / d
    x(n) = (1 - a) x(n-1) + a tanh(W x(n-1) + W_in s(n) + b),      y(n) = R [x(n), s(n)] + r

The signal u is that of some joints of a body, y is the whole body. There is no phase: x remembers the measurements of
about dt / a. One frame of hands and head rarely determines the feet; its past does so better. What follows from s in
proportion need not pass through the neurons.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.motion.rotations import Array
from controller.networks.reservoirs.reservoir import Reservoir, drive
from controller.networks.signals import time_series
from motiondeck_base.errors import MotiondeckError


@dataclass(frozen=True, eq=False)
class Completion:
    """A driven reservoir with a readout of the whole."""

    reservoir: Reservoir  # N neurons with C inputs
    mean: Array  # m of the measured signal, shape (C,), in its unit
    deviation: Array  # d of it, likewise
    readout: Array  # (R, r), shape (D, N + C + 1)
    rate: float  # at which it was learned, Hz
    settling: int  # frames in which the first measurement is held, until the reservoir has forgotten its start

    def complete(self, measured: Array) -> Array:
        """The whole of a measured signal (T, C) at `rate`, shape (T, D); row n follows from the rows up to n.

        MotiondeckError if the signal is not of that shape, or a number is not finite.
        """
        signal = (time_series(measured, "the measured signal", len(self.mean)) - self.mean) / self.deviation
        held = np.concatenate([np.repeat(signal[:1], self.settling, axis=0), signal])
        (states,) = drive(self.reservoir, [held])
        return np.concatenate([states[self.settling :], signal], axis=1) @ self.readout[:, :-1].T + self.readout[:, -1]

    def follow(self, measured: Array) -> LiveCompletion:
        """The same frame by frame, from a measurement (C,) on; MotiondeckError for one of another shape or NaN."""
        return LiveCompletion(self, measured)


class LiveCompletion:
    """A completion while measurements come in."""

    def __init__(self, completion: Completion, measured: Array) -> None:
        first = _values(measured, len(completion.mean))
        if not np.isfinite(first).all():
            raise MotiondeckError("the first measurement has values that are not finite; begin with one that is whole")
        self.completion = completion
        self.state = np.zeros(len(completion.reservoir))  # x, shape (N,)
        self._last = first
        for _ in range(completion.settling):
            self._advance()

    def step(self, measured: Array) -> Array:
        """The next frame, (D,); a value of (C,) that is not finite keeps its last. MotiondeckError for another size."""
        values = _values(measured, len(self._last))
        self._last = np.where(np.isfinite(values), values, self._last)
        self._advance()
        readout = self.completion.readout
        return readout[:, :-1] @ np.concatenate([self.state, self._signal]) + readout[:, -1]

    def _advance(self) -> None:
        own, part = self.completion, self.completion.reservoir
        self._signal = signal = (self._last - own.mean) / own.deviation
        driven = np.tanh(part.weights @ self.state + part.input_weights @ signal + part.bias)
        self.state = (1.0 - part.leak) * self.state + part.leak * driven


def _values(measured: Array, count: int) -> Array:
    try:
        values = np.asarray(measured, dtype=float)
    except (TypeError, ValueError):
        raise MotiondeckError(f"a measurement is {count} numbers, not {measured!r}") from None
    if values.shape != (count,):
        raise MotiondeckError(f"a measurement of shape {values.shape}; {count} values are needed")
    return values
