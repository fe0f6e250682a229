"""Satellites: functions of the centers' state whose weighted sum is the motion (Vakulenko et al. 2017, eqs 2-8).

    x_k = sum_j W_kj Phi_j(q)                                  (eq. 2)
    harmonic     Phi_j(q) = cos(b j q)                         (eq. 3)
    Gaussian     Phi_j(q) = exp(-(b |q - q_j|)^2 / 2)          (eqs 4, 5)
    polynomial   Phi_j(q) = q^(j-1)                            (eq. 6)

The paper writes (3) and (6) for one center; for several, j is a vector of orders and the product with q is the inner
one, or a product of powers.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from controller.motion.rotations import Array, Indices
from motiondeck_base.errors import MotiondeckError


class SatelliteError(MotiondeckError):
    """Satellites that cannot be: a shape, a width or a number that makes no sense."""


class Satellites(Protocol):
    """m functions of a state of d coordinates."""

    def __len__(self) -> int: ...

    def respond(self, states: Array) -> Array:
        """Phi of states (..., d), shape (..., m)."""
        ...


@dataclass(frozen=True, eq=False)
class GaussianSatellites:
    """Radial basis functions, each with its own place and sharpness.

    SatelliteError if the shapes disagree or a number is not finite or a sharpness not positive; it names the satellite.
    """

    places: Array  # q_j, shape (m, d)
    # b_j > 0, shape (m,), or one for all; by default 1 over the spacing of m places in [-1, 1]^d.
    sharpness: Array = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        places, sharpness = np.asarray(self.places), np.asarray(self.sharpness)
        if places.ndim == 2 and sharpness.size == 0 and len(places):
            sharpness = np.array(1.0 / spacing(places.shape[1], len(places)))
        if sharpness.ndim == 0:
            sharpness = np.full(len(places), sharpness)
        object.__setattr__(self, "places", places)
        object.__setattr__(self, "sharpness", sharpness)
        if self.places.ndim != 2 or self.sharpness.shape != self.places.shape[:1]:
            raise SatelliteError(
                f"satellites at places of shape {self.places.shape} with sharpness of shape {self.sharpness.shape}"
            )
        sound = np.isfinite(self.places).all(axis=1) & np.isfinite(self.sharpness) & (self.sharpness > 0.0)
        if not sound.all():
            worst = int(np.flatnonzero(~sound)[0])
            raise SatelliteError(
                f"satellite {worst}: place {self.places[worst]} with sharpness {self.sharpness[worst]} is impossible"
            )

    def __len__(self) -> int:
        return len(self.places)

    def respond(self, states: Array) -> Array:
        return np.exp(-0.5 * np.square(self.sharpness) * self.distances(states))

    def distances(self, states: Array) -> Array:
        """|q - q_j|^2 of states (..., d), shape (..., m)."""
        return np.maximum(
            np.square(states).sum(-1)[..., None] - 2.0 * states @ self.places.T + np.square(self.places).sum(-1), 0.0
        )


@dataclass(frozen=True, eq=False)
class HarmonicSatellites:
    """Cosines of the state (eq. 3)."""

    orders: Indices  # j, shape (m, d)
    base: float = 1.0  # b, the common factor, rad

    def __len__(self) -> int:
        return len(self.orders)

    def respond(self, states: Array) -> Array:
        return np.cos(self.base * (states @ self.orders.T))


@dataclass(frozen=True, eq=False)
class PolynomialSatellites:
    """Monomials of the state (eq. 6)."""

    powers: Indices  # the power of each coordinate, shape (m, d), >= 0

    def __len__(self) -> int:
        return len(self.powers)

    def respond(self, states: Array) -> Array:
        return np.prod(states[..., None, :] ** self.powers, axis=-1)


def lowest_orders(dimensions: int, count: int) -> Indices:
    """The first vectors of whole numbers >= 0 by their sum, shape (count, dimensions): orders for eqs 3 and 6."""
    reach = 1
    while reach**dimensions < count or len(_by_sum(dimensions, reach)) < count:
        reach += 1
    return _by_sum(dimensions, reach)[:count]


def _by_sum(dimensions: int, reach: int) -> Indices:
    """All vectors with a sum below reach, in order of it."""
    grid = np.indices((reach,) * dimensions).reshape(dimensions, -1).T
    total = grid.sum(1)
    return grid[np.argsort(total, kind="stable")][: int((total < reach).sum())]


def grid_places(dimensions: int, count: int) -> Array:
    """Places spread over [-1, 1]^d, shape (count, d): a regular grid where count allows one, else quasi-random."""
    # One dimension takes any count; two take every count whose nearest factors are at most 1 : 2 (25 = 5 x 5, 50 = 5 x
    # 10); more take whole powers.
    sides = _sides(dimensions, count)
    if sides is None:
        return quasi_random_places(dimensions, count, seed=0)
    axes = [np.linspace(-1.0, 1.0, side) if side > 1 else np.zeros(1) for side in sides]
    return np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=-1)


def quasi_random_places(dimensions: int, count: int, seed: int) -> Array:
    """Places of a scrambled Halton sequence in [-1, 1]^d, shape (count, d)."""
    # Here and not above: it takes half a second to import, and playing never needs it.
    from scipy.stats import qmc

    return 2.0 * qmc.Halton(dimensions, scramble=True, rng=np.random.default_rng(seed)).random(count) - 1.0


def spacing(dimensions: int, count: int) -> float:
    """The distance between neighbours of `count` places in [-1, 1]^d."""
    return 2.0 / max(1.0, count ** (1.0 / dimensions) - 1.0)


def _sides(dimensions: int, count: int) -> tuple[int, ...] | None:
    if dimensions == 1:
        return (count,)
    side = round(count ** (1.0 / dimensions))
    if side**dimensions == count:
        return (side,) * dimensions
    if dimensions == 2:
        short = next(s for s in range(int(np.sqrt(count)), 0, -1) if count % s == 0)
        if 2 * short >= count // short:
            return short, count // short
    return None


def logistic(h: Array) -> Array:
    """1 / (1 + exp(-h)), the first sigmoid of eq. 8."""
    return 0.5 + 0.5 * np.tanh(0.5 * h)
