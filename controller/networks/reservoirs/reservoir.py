"""The reservoir: a random recurrent network that is driven by a signal and never trained itself.

    x(n+1) = (1 - a) x(n) + a tanh(W x(n) + W_in p(n+1) + b)        (Deliallisi 2017, eqs 3.4 and 3.8)

The reservoir of a conceptor has leak a = 1; in an echo-state network p is the fed-back output, one frame old.
"""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from controller.networks.signals import number_within, time_series, whole_number
from motiondeck_base.errors import MotiondeckError

Floats = NDArray[Any]  # double or single precision


@dataclass(frozen=True)
class Reservoir:
    """N neurons with C inputs."""

    weights: Floats  # W, shape (N, N)
    input_weights: Floats  # W_in (or W_back), shape (N, C)
    bias: Floats  # b, shape (N,)
    leak: float = 1.0  # a in (0, 1]

    def __len__(self) -> int:
        return len(self.bias)

    def single(self) -> Self:
        """The same in single precision: half the memory and twice as fast to drive."""
        weights, inputs, bias = (a.astype(np.float32) for a in (self.weights, self.input_weights, self.bias))
        return replace(self, weights=weights, input_weights=inputs, bias=bias)


def random_reservoir(
    neurons: int,
    inputs: int,
    spectral_radius: float = 0.9,
    input_scale: float = 1.0,
    bias_scale: float = 0.2,
    *,
    leak: float = 1.0,
    seed: int = 0,
    rng: np.random.Generator | None = None,
) -> Reservoir:
    """Weights drawn from U[-1, 1]; W is scaled to a spectral radius, the others by a factor (section 3.3.1).

    The defaults suit inputs within about [-1, 1] and a fading memory of some ten steps. MotiondeckError if a size is no
    whole number, or a scale is not a number in its range; it names it.

    Args:
        neurons, inputs: N and C.
        spectral_radius: of W, the largest |eigenvalue|; below 1 a reservoir with leak 1 forgets its start.
        input_scale, bias_scale: the largest weight of W_in and of b.
        leak: a in (0, 1]; the smaller, the slower.
        rng: in place of a seed.
    """
    neurons, inputs = whole_number(neurons, "neurons", 1), whole_number(inputs, "inputs", 0)
    spectral_radius = number_within(spectral_radius, "spectral_radius", 0.0, 1e6)
    input_scale = number_within(input_scale, "input_scale", 0.0, 1e6)
    bias_scale = number_within(bias_scale, "bias_scale", 0.0, 1e6)
    leak = number_within(leak, "leak", 1e-9, 1.0)
    rng = np.random.default_rng(whole_number(seed, "seed")) if rng is None else rng
    if not isinstance(rng, np.random.Generator):  # what pyright sees, a user's script does not
        raise MotiondeckError(f"rng is {rng!r}; give a generator: numpy.random.default_rng(SEED)")
    weights = rng.uniform(-1.0, 1.0, (neurons, neurons))
    weights *= spectral_radius / largest_eigenvalue(weights, rng)
    input_weights = input_scale * rng.uniform(-1.0, 1.0, (neurons, inputs))
    return Reservoir(weights, input_weights, bias_scale * rng.uniform(-1.0, 1.0, neurons), leak)


def largest_eigenvalue(weights: Array, rng: np.random.Generator) -> float:
    """|lambda_max| of a square matrix, by Arnoldi iteration where that converges and in full where it does not."""
    if len(weights) > 100:
        from scipy.sparse.linalg import ArpackError, eigs  # slow to import, and nothing that plays needs it

        try:
            tolerance: Any = 1e-4  # scipy's default 0 misleads pyright
            start = rng.standard_normal(len(weights))
            found = eigs(weights, k=6, ncv=60, tol=tolerance, v0=start, return_eigenvectors=False)
            return float(np.abs(found).max())
        except ArpackError:
            pass
    return float(np.abs(np.linalg.eigvals(weights)).max())


def drive(
    reservoir: Reservoir,
    signals: list[Array],
    *,
    state_noise: float | Array = 0.0,
    starts: Floats | None = None,
    rng: np.random.Generator | None = None,
) -> list[Floats]:
    """The states (T_j, N) that signals (T_j, C) leave in the reservoir: row n is the state after input n.

    Each begins at x = 0 unless it is given a start. All signals run side by side, the longest first, so that every step
    is one product with W. Computed in the type of the reservoir's weights. MotiondeckError if there is no signal, one
    is not of that shape, or a number is not finite.

    Args:
        state_noise: standard deviation of noise added to the state before each step, for all or for each signal; needs
            rng.
        starts: the states to start from, shape (signals, N).
    """
    if len(signals) == 0:
        raise MotiondeckError("there are no signals to drive the reservoir with")
    channels = reservoir.input_weights.shape[1]
    signals = [time_series(signal, f"signal {j}", channels) for j, signal in enumerate(signals)]
    kind = reservoir.weights.dtype
    order = sorted(range(len(signals)), key=lambda j: -len(signals[j]))
    lengths = np.array([len(signals[j]) for j in order])
    longest = int(lengths[0])
    # What a signal contributes lies where its states go: they replace it step by step.
    states = np.zeros((longest, len(signals), len(reservoir)), dtype=kind)
    for column, j in enumerate(order):
        states[: lengths[column], column] = signals[j].astype(kind, copy=False) @ reservoir.input_weights.T
    x = np.zeros((len(signals), len(reservoir)), dtype=kind) if starts is None else starts[order].astype(kind)
    noise = np.broadcast_to(np.asarray(state_noise, dtype=kind), len(signals))[order]
    recurrent = np.ascontiguousarray(reservoir.weights.T)
    draw: Any = np.float32 if kind == np.float32 else np.float64
    for n in range(longest):
        live = int(np.searchsorted(-lengths, -n, side="left"))
        x = x[:live]
        if rng is not None and noise.any():
            x = x + noise[:live, None] * rng.standard_normal(x.shape, dtype=draw)
        h = states[n, :live]
        h += x @ recurrent
        h += reservoir.bias
        np.tanh(h, out=h)
        if reservoir.leak != 1.0:
            h *= reservoir.leak
            h += (1.0 - reservoir.leak) * x
        x = h
    out: list[Floats] = [np.empty(0)] * len(signals)
    for column, j in enumerate(order):
        out[j] = states[: lengths[column], column]
    return out
