"""Echo-state experts: one readout a motion, which predicts its next frame (Rodriguez 2012, section 4).

A reservoir is driven by the motion to recognize (teacher forcing):

    x(t+1) = (1 - a) x(t) + a tanh(W x(t) + W_back y(t) + b)
    y_m(t) = W_m x(t),      e_m = mean over t of |y(t) - y_m(t)|^2

Expert m was trained on motion m, so the expert with the least error gives the class. All experts share one reservoir,
and their readouts are ridge regressions from the moments X'X and X'Y of each class.

Experts differ in their mean error on any motion. So costs are centred: the log error of an expert less the mean over
all classes of its log error on their training motions, which follows from the moments.

An expert may be a committee: the neurons are split into groups with separate readouts, and the logarithm of the error
is averaged over groups and joints. That averages out chance errors of a group, and gives a joint that hardly moves the
weight of one that swings, which separates known from unknown motions better (docs/recognition.md).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import add
from typing import Self

import msgspec
import numpy as np
from scipy.linalg import cho_factor, cho_solve

from controller.motion.rotations import Array
from controller.networks.reservoirs.reservoir import Reservoir, drive, random_reservoir
from motiondeck_base.errors import MotiondeckError

SMALLEST_ERROR = 1e-12
A_JOINT = 3  # channels: a position, or a velocity
COMMITTEE_DOUBT = 0.1
STRETCHES = (0.5, 0.7, 1.0, 1.4, 2.0)  # relative durations in the training
STRETCHED_LEAK = 1.0  # neurons without a time constant suit motions learned at several durations
WASHOUT_SHARE = 3  # the washout is at most a third of a clip
MODEL_RIDGE = 0.1  # relative to the mean diagonal of the clips' Gram matrix


class ExpertRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Parameters of experts."""

    neurons: int = 100  # N
    spectral_radius: float = 0.8  # of W
    input_scale: float = 0.5  # of W_back for three channels; it shrinks with the square root of their number
    bias_scale: float = 0.2  # of b
    leak: float = 0.3  # a, in (0, 1]
    ridge: float = 0.1  # relative to the mean diagonal of X'X
    washout: int = 5  # uncounted frames at the start, at most a third of a clip
    seed: int = 1  # of the reservoir
    groups: int = 1  # number of groups of neurons; neurons left over are not read

    def together(self, channels: int) -> int:
        """Number of adjacent channels with a common error: all, or those of a joint for a committee."""
        return A_JOINT if self.groups > 1 and channels % A_JOINT == 0 else channels

    @property
    def doubt(self) -> float:
        """The share of the least cost that is subtracted from the margin: unknown motions have a large one."""
        return COMMITTEE_DOUBT if self.groups > 1 else 0.0

    def __post_init__(self) -> None:
        if not 1 <= self.groups <= max(self.neurons, 1):
            raise MotiondeckError("experts need at least one group, and a neuron in each")
        if self.neurons < 1 or self.washout < 0 or self.seed < 0:
            raise MotiondeckError("experts need at least one neuron, and washout and seed must not be negative")
        if not (0.0 < self.leak <= 1.0 and 0.0 < self.ridge < 1e6 and 0.0 <= self.spectral_radius < 10.0):
            raise MotiondeckError("experts need a leak in (0, 1], a positive ridge, and a spectral radius below 10")


def committee_recipe(
    stretches: Sequence[float] = STRETCHES, *, neurons: int = 200, groups: int = 8, seed: int = 1
) -> ExpertRecipe:
    """The default parameters for recordings of people."""
    leak = STRETCHED_LEAK if len(set(stretches)) > 1 else ExpertRecipe().leak
    return ExpertRecipe(neurons=neurons, groups=groups, seed=seed, leak=leak)


def expert_reservoir(recipe: ExpertRecipe, channels: int) -> Reservoir:
    """The reservoir that all experts of a recipe share."""
    scales = recipe.spectral_radius, recipe.input_scale * float(np.sqrt(3.0 / channels)), recipe.bias_scale
    return random_reservoir(recipe.neurons, channels, *scales, leak=recipe.leak, seed=recipe.seed)


@dataclass(frozen=True)
class Forced:
    """A motion driven through the reservoir."""

    states: Array  # x(t), a function of y up to t - 1, shape (T', N)
    targets: Array  # y(t), shape (T', C)


def force(reservoir: Reservoir, signals: list[Array], washout: int) -> list[Forced]:
    """Drives the reservoir with signals (T_j, C); the washout of a short one is a third of it.

    MotiondeckError if a signal has fewer than two frames or a number that is not finite.
    """
    for number, signal in enumerate(signals):
        if len(signal) < 2:
            raise MotiondeckError(f"motion {number}: {len(signal)} frames; nothing can be predicted from less than 2")
        if not np.isfinite(signal).all():
            raise MotiondeckError(f"motion {number}: its features hold a number that is not finite")
    driven = drive(reservoir, [signal[:-1] for signal in signals])
    out: list[Forced] = []
    for states, signal in zip(driven, signals, strict=True):
        first = min(washout, len(states) // WASHOUT_SHARE)
        out.append(Forced(states[first:], signal[1 + first :]))
    return out


@dataclass(frozen=True)
class Moments:
    """Moments of some motions, from which readouts and their errors follow."""

    xx: Array  # sum of x x', shape (N, N)
    xy: Array  # sum of x y', shape (N, C)
    yy: Array  # sum of y^2, shape (C,)
    count: float  # number of values y, C a frame

    def __add__(self, other: Moments) -> Moments:
        return Moments(self.xx + other.xx, self.xy + other.xy, self.yy + other.yy, self.count + other.count)


def moments(forced: Forced) -> Moments:
    """The moments of one motion."""
    x, y = forced.states, forced.targets
    return Moments(x.T @ x, x.T @ y, np.square(y).sum(0), float(y.size))


def total(of: Iterable[Moments]) -> Moments:
    """The moments of several motions together (at least one)."""
    return reduce(add, of)


def readout(of: Moments, ridge: float) -> Array:
    """W_m, shape (C, N); ridge is relative to the mean diagonal of X'X."""
    neurons = len(of.xx)
    regularised = of.xx + np.eye(neurons) * max(ridge * float(np.trace(of.xx)) / neurons, 1e-12)
    return cho_solve(cho_factor(regularised), of.xy).T


def group_readouts(of: Moments, recipe: ExpertRecipe) -> Array:
    """The readouts of one class, a group each, shape (G, C, N / G)."""
    size = recipe.neurons // recipe.groups
    parts = [slice(size * group, size * (group + 1)) for group in range(recipe.groups)]
    return np.stack([readout(Moments(of.xx[p, p], of.xy[p], of.yy, of.count), recipe.ridge) for p in parts])


def frame_errors(readouts: Array, forced: Forced, together: int) -> Array:
    """The squared errors of readouts (M, G, C, N / G), averaged over `together` channels, (T', M, K)."""
    experts, groups, channels, size = readouts.shape
    found = np.empty((len(forced.states), experts, groups, channels // together))
    for group in range(groups):
        guess = forced.states[:, size * group : size * (group + 1)] @ readouts[:, group].reshape(-1, size).T
        off = guess.reshape(-1, experts, channels) - forced.targets[:, None]
        found[:, :, group] = np.square(off, out=off).reshape(*off.shape[:2], -1, together).mean(-1)
    return found.reshape(*found.shape[:2], -1)


def log_errors(readouts: Array, forced: list[Forced], together: int) -> Array:
    """The logarithm of each expert's mean squared error on each motion, (motions, M); of a committee the mean."""
    means = np.array([frame_errors(readouts, f, together).mean(0) for f in forced])
    return np.log(np.maximum(means, SMALLEST_ERROR)).mean(-1)


def mean_errors(readouts: Array, of: Moments, together: int) -> Array:
    """The mean squared errors of one expert's readouts (G, C, N / G) on the motions of some moments, shape (K,)."""
    groups, channels, size = readouts.shape
    found = np.empty((groups, channels))
    for group, weights in enumerate(readouts):
        own = slice(size * group, size * (group + 1))
        found[group] = of.yy - 2.0 * (weights * of.xy[own].T).sum(1) + ((weights @ of.xx[own, own]) * weights).sum(1)
    found *= channels / of.count
    return np.maximum(found.reshape(groups, -1, together).mean(-1).ravel(), SMALLEST_ERROR)


def centre(readouts: Array, classes: Sequence[Moments], together: int) -> Array:
    """The mean over all classes of each expert's log error, shape (M,)."""
    return np.log([[mean_errors(own, of, together) for of in classes] for own in readouts]).mean((1, 2))


@dataclass(frozen=True, eq=False)
class ExpertBank:
    """M experts that share a reservoir of N neurons."""

    recipe: ExpertRecipe
    reservoir: Reservoir
    classes: tuple[str, ...]  # names of the motions, length M
    moments: tuple[Moments, ...]  # of each class's training motions

    @cached_property
    def readouts(self) -> Array:
        """The readouts of each expert, by groups of neurons, shape (M, G, C, N / G)."""
        return np.array([group_readouts(of, self.recipe) for of in self.moments])

    @property
    def together(self) -> int:
        """Number of adjacent channels with a common error."""
        return self.recipe.together(len(self.moments[0].yy))

    @cached_property
    def centre(self) -> Array:
        """The mean log error of each expert over all classes, shape (M,)."""
        return centre(self.readouts, self.moments, self.together)

    def force(self, signals: list[Array]) -> list[Forced]:
        """Signals (T_j, C) forced through the reservoir."""
        return force(self.reservoir, signals, self.recipe.washout)

    def costs(self, forced: list[Forced]) -> Array:
        """The centred log error of each expert on each forced signal, shape (signals, M); the least names the class."""
        return log_errors(self.readouts, forced, self.together) - self.centre

    def confidences(self, costs: Array) -> Array:
        """The confidence of verdicts on costs (signals, M), shape (signals,), for comparison with the threshold."""
        return margins(costs) - self.recipe.doubt * costs.min(1)


def teach(recipe: ExpertRecipe, signals: list[Array], labels: Sequence[str]) -> ExpertBank:
    """A bank trained on labelled signals (T_j, C); its classes are in alphabetical order."""
    reservoir = expert_reservoir(recipe, signals[0].shape[1])
    forced = force(reservoir, signals, recipe.washout)
    classes = tuple(sorted(set(labels)))
    of = [total(moments(f) for f, label in zip(forced, labels, strict=True) if label == name) for name in classes]
    return ExpertBank(recipe, reservoir, classes, tuple(of))


def margins(costs: Array) -> Array:
    """The difference between the second-least and the least cost, shape (signals,)."""
    if costs.shape[1] < 2:
        return np.zeros(len(costs))
    two = np.partition(costs, 1, axis=1)[:, :2]
    return two[:, 1] - two[:, 0]


@dataclass(frozen=True, eq=False)
class ModelSpace:
    """A linear classifier of readouts with G C N / G = D numbers into M classes; its votes have the unit of a cost.

    A clip is represented by the readouts that predict it best (reservoir model space: Bianchi, Scardapane, Løkse and
    Jenssen, IEEE Trans. Neural Netw. Learn. Syst. 32, 2021). What separates the classes of the training there is
    learned from all of them together, which experts, each of one class, do not do.
    """

    weights: Array  # shape (M, D)
    offset: Array  # shape (M,)

    @classmethod
    def fit(cls, clips: Sequence[Moments], labels: Sequence[int], costs: Array, recipe: ExpertRecipe) -> Self:
        """The classifier of training clips with labels 0 to M - 1 and the experts' costs of them, shape (clips, M).

        Its votes on the training clips spread as far as the costs do, so both count alike.
        """
        points = _points(clips, recipe).astype(np.float32)  # 80 kB a clip and duration
        middle = points.mean(0)
        points -= middle
        gram = (points @ points.T).astype(np.float64)
        aims = np.eye(costs.shape[1])[list(labels)]
        aims -= aims.mean(0)
        aims -= aims.mean(1, keepdims=True)
        regulariser = max(MODEL_RIDGE * float(np.trace(gram)) / len(gram), 1e-12)
        gain = np.linalg.solve(gram + np.eye(len(gram)) * regulariser, aims)
        gain *= (costs - costs.mean(1, keepdims=True)).std() / max(float((gram @ gain).std()), 1e-12)
        weights = (points.T @ gain).T.astype(np.float32)
        return cls(weights, -(weights @ middle.astype(np.float64)))

    def votes(self, clips: Sequence[Moments], recipe: ExpertRecipe) -> Array:
        """How like each class each clip is, less the mean over classes, shape (clips, M)."""
        return _points(clips, recipe) @ self.weights.T + self.offset


def _points(clips: Sequence[Moments], recipe: ExpertRecipe) -> Array:
    return np.array([group_readouts(of, recipe).ravel() for of in clips])
