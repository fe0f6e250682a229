"""A switching module's design: one center and m satellites with m states of rest (Vakulenko et al. 2017).

    w_j' = s(b z - h_j) - w_j / kappa                            (eq. 14)
    z'   = s(sum_j a_j w_j / kappa - h) - decay z                (eq. 15, decay = xi lambda)

At rest w_j = kappa s(b z - h_j), so kappa drops out and z is where  G(z) = s(S(z) - h)  meets the line decay z, with
S(z) = sum_j a_j s(b z - h_j): a staircase with steps at h_j / b. We want its m flat parts at z_k = k - 1/2 + beta, the
steps half-way between them. S(z_k) - h = logit(decay z_k) are then m equations, linear in a_1 .. a_(m-1) and h; the
last satellite sits above z_m with a small a_m.

All a_j and b being positive the system is cooperative: the leading eigenvalue at a state of rest is real, negative
where G' < decay, for every kappa > 0, and nothing oscillates. What Lemma 1 promises is computed when a module is
designed, and checked.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from controller.networks.centralized.satellites import logistic
from motiondeck_base.errors import MotiondeckError

LAST_WEIGHT = 0.05
MOST_MOTIONS = 200


class SwitchingModuleError(MotiondeckError):
    """A switching module that is impossible, or does not do what Lemma 1 demands."""


@dataclass(frozen=True, eq=False)
class RestPoint:
    """A state in which the module stays."""

    z: float  # of its center
    eigenvalues: NDArray[np.complex128]  # of the Jacobian there, shape (m + 1,), complex, in units of 1 / module time

    @property
    def stable(self) -> bool:
        """Whether the module returns to it."""
        return bool(self.eigenvalues.real.max() < 0.0)


@dataclass(frozen=True)
class Window:
    """For which xi, as multiples of the designed one, the module has how many states."""

    low: float  # above it, and below `high`, there are m stable states
    high: float
    single: float  # above it there is one


@dataclass(frozen=True, eq=False)
class ModuleDesign:
    """The constants of eqs 14 and 15 for m motions; made by `design_module`."""

    weights: Array  # a_j, shape (m,)
    slope: float  # b, the same for all satellites
    thresholds: Array  # h_j, shape (m,)
    threshold: float  # h
    decay: float  # xi lambda
    kappa: float  # time constant of the satellites
    beta: float  # of Lemma 1: state k lies in (k - 1 + beta, k + beta), counted from 1
    targets: Array  # z_k, shape (m,)

    def __len__(self) -> int:
        return len(self.weights)

    def satellites(self, z: Array | float) -> Array:
        """s(b z - h_j) of z (...), shape (..., m): what w_j / kappa tends to."""
        return logistic(self.slope * np.asarray(z)[..., None] - self.thresholds)

    def staircase(self, z: Array | float) -> Array:
        """G(z), shape (...)."""
        return logistic(self.satellites(z) @ self.weights - self.threshold)

    def memberships(self, z: Array | float) -> Array:
        """The membership of z (...) in each motion, shape (..., m): s_(k-1) - s_k of the module's own satellites.

        They are not negative, add up to one, and are flat where the module rests, so that noise on z hardly shows.
        """
        steps = self.satellites(z)[..., :-1]
        edge = np.ones((*steps.shape[:-1], 1))
        return np.concatenate([edge, steps], axis=-1) - np.concatenate([steps, 0.0 * edge], axis=-1)

    def jacobian(self, z: float) -> Array:
        """Of eqs 15 and 14, in this order, at the state of rest with this z, shape (m + 1, m + 1)."""
        s, level = self.satellites(z), float(self.staircase(z))
        out = -np.diag(np.append(self.decay, np.full(len(self), 1.0 / self.kappa)))
        out[0, 1:] = level * (1.0 - level) * self.weights / self.kappa
        out[1:, 0] = s * (1.0 - s) * self.slope
        return out

    @cached_property
    def rest_points(self) -> tuple[RestPoint, ...]:
        """All states of rest by rising z, stable and unstable in turn."""

        # Here and not above: it takes half a second to import, and playing never needs it.
        from scipy.optimize import brentq

        def excess(z: float) -> float:
            return float(self.staircase(z)) - self.decay * z

        grid = np.linspace(0.0, 1.0 / self.decay, 60 * len(self) + 60)
        above = np.array([excess(z) > 0.0 for z in grid])
        changes = np.flatnonzero(above[:-1] != above[1:])
        roots = [float(brentq(excess, grid[i], grid[i + 1])) for i in changes]  # pyright: ignore[reportArgumentType]
        return tuple(RestPoint(z, np.linalg.eigvals(self.jacobian(z)).astype(np.complex128)) for z in roots)

    @cached_property
    def window(self) -> Window:
        """From the extremes of G(z) / z, which equals xi lambda at rest and falls where rest is stable."""
        z = np.linspace(1e-3, 1.2 * (self.targets[-1] + 1.0), 4000 + 400 * len(self))
        ratio = self.staircase(z) / z
        turn = np.diff(np.sign(np.diff(ratio)))
        highs, lows = ratio[1:-1][turn < 0], ratio[1:-1][turn > 0]
        if len(self) == 1:
            return Window(0.0, np.inf, 0.0)
        ends = lows[: len(self) - 1].max(), highs[: len(self) - 1].min(), highs.max()
        return Window(*(float(end) / self.decay for end in ends))


@lru_cache(maxsize=32)
def design_module(motions: int, beta: float = 0.5, slope: float = 24.0, kappa: float = 0.05) -> ModuleDesign:
    """The module for 1 to MOST_MOTIONS motions, checked against Lemma 1.

    With beta in (0, 1), slope b from 6 to 48 (how steep the steps are), and kappa > 0 in module time.
    SwitchingModuleError if an argument is out of range, or a state is missing, unstable or out of its place.
    """
    if not 1 <= motions <= MOST_MOTIONS:
        raise SwitchingModuleError(
            f"{motions} motions in one centralized network; its switching module is made for 1 to {MOST_MOTIONS}. "
            "Make several libraries of them."
        )
    for name, value, low, high in (("beta", beta, 0.0, 1.0), ("slope", slope, 5.9, 48.1), ("kappa", kappa, 0.0, 1e3)):
        if not low < value < high:
            raise SwitchingModuleError(f"a switching module with {name} = {value}; give {low:g} to {high:g}")
    targets = np.arange(1.0, motions + 0.5) - 0.5 + beta
    thresholds = slope * (targets + 0.5)
    decay = 1.0 / (motions + 1.0 + beta)
    steps = logistic(slope * targets[:, None] - thresholds)
    equations = np.column_stack([steps[:, :-1], -np.ones(motions)])
    solved = np.linalg.solve(equations, np.log(decay * targets / (1.0 - decay * targets)) - LAST_WEIGHT * steps[:, -1])
    weights = np.append(solved[:-1], LAST_WEIGHT)
    design = ModuleDesign(weights, slope, thresholds, float(solved[-1]), decay, kappa, beta, targets)
    _check(design)
    return design


def _check(design: ModuleDesign) -> None:
    m, beta = len(design), design.beta
    if not (design.weights > 0.0).all():
        raise SwitchingModuleError(f"the switching module for {m} motions would need a negative weight")
    stable = [point.z for point in design.rest_points if point.stable]
    if len(stable) != m or len(design.rest_points) != 2 * m - 1:
        raise SwitchingModuleError(f"the switching module for {m} motions has {len(stable)} stable states")
    for k, z in enumerate(stable):
        if not k + beta < z < k + 1 + beta:
            raise SwitchingModuleError(f"state {k + 1} of the switching module lies at {z:g}, out of its place")
    if not design.window.low < 1.0 < design.window.high:
        raise SwitchingModuleError(f"the switching module for {m} motions keeps its states for no range of xi")
