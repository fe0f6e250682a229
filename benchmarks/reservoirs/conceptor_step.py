"""One frame of a conceptor, low-rank and dense, beside reservoirpy.

All play 61 channels from random weights of the right size, one core, in one run and in turns of BLOCK steps, so that a
busy machine slows them alike and each has its own weights in the cache as it would when it plays alone. What is printed
is the median time of a step. reservoirpy is only asked where it is installed
(pip install reservoirpy); it is a peer, not a dependency.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import time
from collections.abc import Callable

import numpy as np

from controller.networks.conceptor.network import ConceptorMotion, ConceptorNetwork

CHANNELS = 61
BLOCK = 50

Step = Callable[[], object]


def low_rank(neurons: int, rank: int, rng: np.random.Generator) -> Step:
    """Ours: z -> W U z -> tanh -> S U' -> z -> y, float32."""
    shapes = ((neurons, rank), (neurons,), (rank, neurons), (rank,), (CHANNELS, rank), (CHANNELS,), (2, rank))
    part = ConceptorMotion(*(np.float32(0.1) * rng.standard_normal(s, dtype=np.float32) for s in shapes))
    network = ConceptorNetwork({"motion": part})
    out = np.empty(CHANNELS)
    return lambda: network.advance(out)


def dense(neurons: int, kind: type, rng: np.random.Generator) -> Step:
    """The thesis's: x(n+1) = C tanh(W x(n) + b),  y = W_out x  (eqs 3.14, 3.15)."""
    weights, conceptor = (rng.standard_normal((neurons, neurons)).astype(kind) / neurons**0.5 for _ in range(2))
    bias, readout = rng.standard_normal(neurons).astype(kind), rng.standard_normal((CHANNELS, neurons)).astype(kind)
    x = rng.standard_normal(neurons).astype(kind)
    hidden, y = np.empty_like(x), np.empty(CHANNELS, dtype=kind)

    def step() -> None:
        np.dot(weights, x, out=hidden)
        np.add(hidden, bias, out=hidden)
        np.tanh(hidden, out=hidden)
        np.dot(conceptor, hidden, out=x)
        np.dot(readout, x, out=y)

    return step


def reservoirpy_esn(neurons: int, rng: np.random.Generator) -> Step | None:
    """reservoirpy's leaky reservoir and ridge readout, one step of its own making; None where it is not installed."""
    try:
        from reservoirpy.nodes import Reservoir, Ridge
    except ImportError:
        return None
    reservoir = Reservoir(neurons, lr=0.6, sr=1.0, seed=1)
    readout = Ridge(ridge=0.5)
    signal = rng.standard_normal((300, CHANNELS))
    network = reservoir >> readout
    network.fit(signal, signal)
    sample = signal[0]
    try:
        network.step(sample)
    except (AttributeError, TypeError):  # before version 0.4 a model is called
        return lambda: network(sample[None])
    return lambda: network.step(sample)


def medians(steps: dict[str, Step], count: int) -> dict[str, float]:
    """The median time of each step in microseconds."""
    spent: dict[str, list[float]] = {name: [] for name in steps}
    for _ in range(-(-count // BLOCK)):
        for name, step in steps.items():
            for _ in range(BLOCK):
                began = time.perf_counter()
                step()
                spent[name].append(time.perf_counter() - began)
    return {name: 1e6 * float(np.median(times)) for name, times in spent.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--neurons", type=int, default=1000)
    parser.add_argument("--rank", type=int, default=50)
    parser.add_argument("--steps", type=int, default=2000)
    given = parser.parse_args()
    rng = np.random.default_rng(0)
    steps = {
        f"ours, rank {given.rank}, float32": low_rank(given.neurons, given.rank, rng),
        "thesis, dense, float32": dense(given.neurons, np.float32, rng),
        "thesis, dense, float64": dense(given.neurons, np.float64, rng),
    }
    peer = reservoirpy_esn(given.neurons, rng)
    if peer is not None:
        steps["reservoirpy, echo state"] = peer
    times = medians(steps, given.steps)
    ours = next(iter(times.values()))
    for name, spent in times.items():
        print(f"{name:28} {spent:8.1f} us   {spent / ours:6.1f} x ours")
    if peer is None:
        print("reservoirpy                  not installed (pip install reservoirpy)")


if __name__ == "__main__":
    main()
