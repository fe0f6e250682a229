"""The proposal's own first check of its networks (section 5): a sine that runs free, the Henon series one step ahead.

Its networks have no bias, so that every state is an odd function of the series, while the Henon map is an even one of
its last value. What the map needs must then be put together from older values; with a bias the same number of neurons
errs two to three times less.
"""

from __future__ import annotations

import msgspec
import numpy as np

from controller.learning.recognition.experts import force
from controller.motion.rotations import Array
from controller.networks.reservoirs.reservoir import Reservoir, random_reservoir

WASHOUT, LEARNED, ASKED = 100, 500, 500


class FirstCheck(msgspec.Struct, frozen=True, kw_only=True):
    """Normalised root mean square errors; 1 is as bad as always saying the mean.

    Attributes:
        sine_free_run: over the first ASKED steps that the network runs on its own.
        henon_one_step: over ASKED steps after those it learned from.
    """

    sine_free_run: float
    henon_one_step: float


def first_check(neurons: int, bias_scale: float, seed: int = 1) -> FirstCheck:
    """Learns both series with one network each."""
    reservoir = random_reservoir(
        neurons, 1, spectral_radius=0.8, input_scale=1.0, bias_scale=bias_scale, rng=np.random.default_rng(seed)
    )
    return FirstCheck(sine_free_run=_free_run(reservoir, sine()), henon_one_step=_one_step(reservoir, henon()))


def sine() -> Array:
    """sin(n/4)/2, shape (T, 1)."""
    return 0.5 * np.sin(np.arange(WASHOUT + LEARNED + ASKED + 1) / 4.0)[:, None]


def henon() -> Array:
    """z(n+1) = 1 - 1.4 z(n)^2 + 0.3 z(n-1), about halved to fit into [-1, 1], shape (T, 1)."""
    z = np.zeros(WASHOUT + LEARNED + ASKED + 1)
    z[1] = 0.1
    for n in range(1, len(z) - 1):
        z[n + 1] = 1.0 - 1.4 * z[n] ** 2 + 0.3 * z[n - 1]
    return (z / 1.3)[:, None]


def _one_step(reservoir: Reservoir, series: Array) -> float:
    forced = force(reservoir, [series], WASHOUT)[0]
    weights = _pseudoinverse(forced.states[:LEARNED], forced.targets[:LEARNED])
    return _nrmse(forced.states[LEARNED:] @ weights, forced.targets[LEARNED:])


def _free_run(reservoir: Reservoir, series: Array) -> float:
    forced = force(reservoir, [series], WASHOUT)[0]
    weights = _pseudoinverse(forced.states[:LEARNED], forced.targets[:LEARNED])
    x = forced.states[LEARNED - 1]
    out = np.empty((ASKED, 1))
    y = forced.targets[LEARNED - 1]
    for n in range(ASKED):
        x = np.tanh(reservoir.weights @ x + reservoir.input_weights @ y + reservoir.bias)
        out[n] = y = x @ weights
    return _nrmse(out, forced.targets[LEARNED : LEARNED + ASKED])


def _pseudoinverse(states: Array, targets: Array) -> Array:
    return np.linalg.pinv(states) @ targets


def _nrmse(guess: Array, truth: Array) -> float:
    return float(np.sqrt(np.mean(np.square(guess - truth)) / truth.var()))


class CheckRow(FirstCheck, frozen=True, kw_only=True):
    """The median over networks of one size.

    Attributes:
        neurons: of the network.
        bias: whether it has one.
    """

    neurons: int
    bias: bool


def checks(sizes: tuple[int, ...] = (50, 200), seeds: int = 5) -> list[CheckRow]:
    """The check for networks of several sizes, without a bias as proposed and with one; medians over seeds."""
    rows: list[CheckRow] = []
    for neurons in sizes:
        for bias in (False, True):
            found = [first_check(neurons, 0.2 if bias else 0.0, seed) for seed in range(1, seeds + 1)]
            rows.append(
                CheckRow(
                    neurons=neurons,
                    bias=bias,
                    sine_free_run=float(np.median([one.sine_free_run for one in found])),
                    henon_one_step=float(np.median([one.henon_one_step for one in found])),
                )
            )
    return rows
