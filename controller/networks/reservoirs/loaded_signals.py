"""A reservoir that goes on without input as signals drove it, and the conceptor of each (Jaeger 2014, chapter 3).

    x(n+1) = C tanh(W x(n) + b),      y(n) = W_out x(n)        (Jaeger 2014, eqs 9, 10; Deliallisi 2017, eqs 3.14, 3.15)

Here conceptors are dense matrices of shape (N, N), to be computed with as in `conceptor_algebra`: the reservoir plays
whatever C it is given. `conceptor.ConceptorNetwork` is the fast form in which motions are played.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array
from controller.networks.reservoirs.conceptor_algebra import conceptor
from controller.networks.reservoirs.reservoir import Reservoir
from controller.networks.signals import whole_number
from motiondeck_base.errors import MotiondeckError, UnknownNameError


@dataclass(frozen=True, eq=False)
class LoadedSignals:
    """N neurons that have learned signals of D channels."""

    reservoir: Reservoir  # as it was drawn: W*, W_in and b
    weights: Array  # W, shape (N, N): W* with the signals loaded into it
    readout: Array  # W_out, shape (D, N), to normalised channels
    normalisation: Normalisation  # between the signals' units and [-1, 1]
    states: Mapping[str, Array]  # of each signal by its name, after the washout, shape (T, N)

    def correlation(self, signal: str) -> Array:
        """R = X' X / T of a signal's states, shape (N, N) (Jaeger 2014, section 3.4); UnknownNameError if none."""
        UnknownNameError.check("signal", signal, self.states)
        states = self.states[signal]
        return states.T @ states / len(states)

    def conceptor(self, signal: str, aperture: float = 10.0) -> Array:
        """C of a signal, shape (N, N).

        UnknownNameError if there is no such signal; it names the nearest. MotiondeckError if the aperture is not > 0.
        """
        return conceptor(self.correlation(signal), aperture)

    def run(self, c: Array, steps: int, start: Array | None = None) -> Array:
        """Runs free with a conceptor (N, N), of a signal or computed from others; a signal (steps, D) in its own units.

        `start` is the state before the first step, shape (N,), by default the first of the first signal. Where there
        are several attractors it decides between them: `states[signal][0]` begins in a signal's own. MotiondeckError if
        a shape is wrong, or steps is no whole number.
        """
        return self.morph(c, c, np.zeros(whole_number(steps, "steps")), start)

    def morph(self, first: Array, second: Array, shares: Array, start: Array | None = None) -> Array:
        """Runs free with the conceptor (1 - mu) C_1 + mu C_2 (Jaeger 2014, section 3.7; Deliallisi 2017, eq. 3.17).

        The signal, shape (steps, D), in its own units, for `shares`, the mu of each step, shape (steps,); beyond [0, 1]
        it extrapolates. `start` as for `run`. MotiondeckError if a shape is wrong, or a share is not finite.
        """
        shares = np.asarray(shares, dtype=np.float64)
        if shares.ndim != 1 or not np.isfinite(shares).all():
            raise MotiondeckError(f"shares of shape {shares.shape}; one finite number a step is needed, (steps,)")
        first, second = np.asarray(first), np.asarray(second)
        x = next(iter(self.states.values()))[0] if start is None else np.asarray(start)
        expected = (len(self.reservoir), len(self.reservoir))
        if not first.shape == second.shape == expected or x.shape != (len(self.reservoir),):
            raise MotiondeckError(
                f"conceptors of shape {first.shape} and {second.shape} and a state of shape {x.shape} "
                f"do not fit a reservoir of {len(self.reservoir)} neurons"
            )
        out = np.empty((len(shares), len(self.readout)))
        for step, mu in enumerate(shares):
            hidden = np.tanh(self.weights @ x + self.reservoir.bias)
            x = (1.0 - mu) * (first @ hidden) + mu * (second @ hidden)
            out[step] = self.readout @ x
        return self.normalisation.invert(out)
