"""The reservoir: a random recurrent network that is driven by a signal and never trained itself.

    x(n+1) = (1 - a) x(n) + a tanh(W x(n) + W_in p(n+1) + b)        (Deliallisi 2017, eqs 3.4 and 3.8)

The reservoir of a conceptor has leak a = 1; in an echo-state network p is the fed-back output, one frame old.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import ArpackError, eigs

from controller.rotations import Array


@dataclass(frozen=True)
class Reservoir:
    """N neurons with C inputs.

    Attributes:
        weights: W, shape (N, N).
        input_weights: W_in (or W_back), shape (N, C).
        bias: b, shape (N,).
        leak: a in (0, 1].
    """

    weights: Array
    input_weights: Array
    bias: Array
    leak: float = 1.0

    def __len__(self) -> int:
        return len(self.bias)


def random_reservoir(
    neurons: int,
    inputs: int,
    *,
    spectral_radius: float,
    input_scale: float,
    bias_scale: float,
    rng: np.random.Generator,
    leak: float = 1.0,
) -> Reservoir:
    """Weights drawn from U[-1, 1]; W is scaled to a spectral radius, the others by a factor (section 3.3.1)."""
    weights = rng.uniform(-1.0, 1.0, (neurons, neurons))
    weights *= spectral_radius / largest_eigenvalue(weights, rng)
    return Reservoir(
        weights=weights,
        input_weights=input_scale * rng.uniform(-1.0, 1.0, (neurons, inputs)),
        bias=bias_scale * rng.uniform(-1.0, 1.0, neurons),
        leak=leak,
    )


def largest_eigenvalue(weights: Array, rng: np.random.Generator) -> float:
    """|lambda_max| of a square matrix, by Arnoldi iteration where that converges and in full where it does not."""
    if len(weights) > 100:
        try:
            found = eigs(
                weights,
                k=6,
                ncv=60,
                tol=1e-4,  # pyright: ignore[reportArgumentType] (scipy's default 0 misleads it)
                v0=rng.standard_normal(len(weights)),
                return_eigenvectors=False,
            )
            return float(np.abs(found).max())
        except ArpackError:
            pass
    return float(np.abs(np.linalg.eigvals(weights)).max())


def drive(
    reservoir: Reservoir,
    signals: list[Array],
    *,
    state_noise: float = 0.0,
    starts: Array | None = None,
    rng: np.random.Generator | None = None,
) -> list[Array]:
    """The states that signals leave in the reservoir, each started from x = 0 unless it is given a start.

    All signals run side by side, the longest first, so that every step is one product with W.

    Args:
        reservoir: what is driven.
        signals: arrays (T_j, C); row n is the input of step n.
        state_noise: standard deviation of noise added to the state before each step; needs rng.
        starts: the states to start from, shape (signals, N).
        rng: source of the noise.

    Returns:
        One array (T_j, N) a signal: row n is the state after input n.
    """
    order = sorted(range(len(signals)), key=lambda j: -len(signals[j]))
    lengths = np.array([len(signals[j]) for j in order])
    longest = int(lengths[0])
    inputs = np.zeros((longest, len(signals), reservoir.input_weights.shape[1]))
    for column, j in enumerate(order):
        inputs[: lengths[column], column] = signals[j]
    states = np.zeros((longest, len(signals), len(reservoir)))
    x = np.zeros((len(signals), len(reservoir))) if starts is None else starts[order]
    for n in range(longest):
        live = int(np.searchsorted(-lengths, -n, side="left"))
        x = x[:live]
        if state_noise > 0.0 and rng is not None:
            x = x + state_noise * rng.standard_normal(x.shape)
        h = x @ reservoir.weights.T + inputs[n, :live] @ reservoir.input_weights.T + reservoir.bias
        x = (1.0 - reservoir.leak) * x + reservoir.leak * np.tanh(h)
        states[n, :live] = x
    out: list[Array] = [np.empty(0)] * len(signals)
    for column, j in enumerate(order):
        out[j] = states[: lengths[column], column]
    return out
