"""The switching module: one center and m satellites with m states of rest, one for each motion (Vakulenko et al. 2017).

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

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from controller.networks.centralized.satellites import logistic
from controller.rotations import Array
from motiondeck_base.errors import MotiondeckError

LAST_WEIGHT = 0.05
MOST_MOTIONS = 200


class SwitchingModuleError(MotiondeckError):
    """A switching module that is impossible, or does not do what Lemma 1 demands."""


@dataclass(frozen=True, eq=False)
class RestPoint:
    """A state in which the module stays.

    Attributes:
        z: of its center.
        eigenvalues: of the Jacobian there, shape (m + 1,), complex, in units of 1 / module time.
    """

    z: float
    eigenvalues: NDArray[np.complex128]

    @property
    def stable(self) -> bool:
        """Whether the module returns to it."""
        return bool(self.eigenvalues.real.max() < 0.0)


@dataclass(frozen=True)
class Window:
    """For which xi, as multiples of the designed one, the module has how many states.

    Attributes:
        low, high: between them there are m stable states.
        single: above it there is one.
    """

    low: float
    high: float
    single: float


@dataclass(frozen=True, eq=False)
class ModuleDesign:
    """The constants of eqs 14 and 15 for m motions; made by `design_module`.

    Attributes:
        weights: a_j, shape (m,).
        slope: b, the same for all satellites.
        thresholds: h_j, shape (m,).
        threshold: h.
        decay: xi lambda.
        kappa: how fast satellites follow the center.
        beta: of Lemma 1: state k lies in (k - 1 + beta, k + beta), counted from 1.
        targets: z_k, shape (m,).
    """

    weights: Array
    slope: float
    thresholds: Array
    threshold: float
    decay: float
    kappa: float
    beta: float
    targets: Array

    def __len__(self) -> int:
        return len(self.weights)

    def satellites(self, z: Array | float) -> Array:
        """s(b z - h_j) of z (...), shape (..., m): what w_j / kappa tends to."""
        return logistic(self.slope * np.asarray(z)[..., None] - self.thresholds)

    def staircase(self, z: Array | float) -> Array:
        """G(z), shape (...)."""
        return logistic(self.satellites(z) @ self.weights - self.threshold)

    def memberships(self, z: Array | float) -> Array:
        """How much z (...) belongs to each motion, shape (..., m): s_(k-1) - s_k of the module's own satellites.

        They are not negative, add up to one, and are flat where the module rests, so that noise on z hardly shows.
        """
        steps = self.satellites(z)[..., :-1]
        edge = np.ones((*steps.shape[:-1], 1))
        return np.concatenate([edge, steps], axis=-1) - np.concatenate([steps, 0.0 * edge], axis=-1)

    def jacobian(self, z: float) -> Array:
        """Of eqs 15 and 14, in this order, at the state of rest with this z, shape (m + 1, m + 1)."""
        s, level = self.satellites(z), float(self.staircase(z))
        m = len(self)
        out = np.zeros((m + 1, m + 1))
        out[0, 0] = -self.decay
        out[0, 1:] = level * (1.0 - level) * self.weights / self.kappa
        out[1:, 0] = s * (1.0 - s) * self.slope
        out[np.arange(1, m + 1), np.arange(1, m + 1)] = -1.0 / self.kappa
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
        return Window(
            float(lows[: len(self) - 1].max()) / self.decay,
            float(highs[: len(self) - 1].min()) / self.decay,
            float(highs.max()) / self.decay,
        )


@lru_cache(maxsize=32)
def design_module(motions: int, beta: float = 0.5, slope: float = 24.0, kappa: float = 0.05) -> ModuleDesign:
    """The module for a number of motions, checked against Lemma 1.

    Args:
        motions: m, 1 to MOST_MOTIONS.
        beta: in (0, 1).
        slope: b, 6 to 48: how steep the steps are.
        kappa: > 0, in module time.

    Raises:
        SwitchingModuleError: if an argument is out of range, or a state is missing, unstable or out of its place.
    """
    if not 1 <= motions <= MOST_MOTIONS:
        raise SwitchingModuleError(
            f"{motions} motions in one centralized network; its switching module is made for 1 to {MOST_MOTIONS}. "
            "Make several libraries of them."
        )
    for name, value, low, high in (("beta", beta, 0.0, 1.0), ("slope", slope, 5.9, 48.1), ("kappa", kappa, 0.0, 1e3)):
        if not low < value < high:
            raise SwitchingModuleError(
                f"a switching module with {name} = {value}; it lies between {low:g} and {high:g}"
            )
    targets = np.arange(1.0, motions + 0.5) - 0.5 + beta
    thresholds = slope * (targets + 0.5)
    decay = 1.0 / (motions + 1.0 + beta)
    steps = logistic(slope * targets[:, None] - thresholds)
    equations = np.column_stack([steps[:, :-1], -np.ones(motions)])
    solution = np.linalg.solve(
        equations, np.log(decay * targets / (1.0 - decay * targets)) - LAST_WEIGHT * steps[:, -1]
    )
    weights = np.append(solution[:-1], LAST_WEIGHT)
    design = ModuleDesign(weights, slope, thresholds, float(solution[-1]), decay, kappa, beta, targets)
    _check(design)
    return design


def _check(design: ModuleDesign) -> None:
    """Refuses a module that does not do what Lemma 1 demands."""
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


@dataclass(slots=True)
class CommandInput:
    """What a command does to eqs 14 and 15 for a while; everything zero is no command.

    Attributes:
        pull, towards: adds pull (towards - z) to z': a clamp current.
        level: added to the argument of each satellite, shape (m,).
        haste: multiplies the right side of eq. 15.
        xi: multiplies xi.
        kick: added to z'.
    """

    level: Array
    pull: float = 0.0
    towards: float = 0.0
    haste: float = 1.0
    xi: float = 1.0
    kick: float = 0.0


@dataclass(frozen=True, eq=False)
class Command:
    """A switch to one motion: drives one after another, each for some module time."""

    phases: tuple[tuple[float, CommandInput], ...]

    @property
    def lasts(self) -> float:
        """In module time."""
        return sum(time for time, _ in self.phases)

    def spans(self, elapsed: float, time: float) -> Iterator[tuple[float, CommandInput | None]]:
        """What it does in a step: pieces of module time, each with its drive, None after the end.

        A step is cut where a drive ends: a kick that lasts a step too long reaches the next state.
        """
        for lasts, drive in self.phases:
            span = min(time, lasts - elapsed)
            if span > 0.0:
                yield span, drive
                time -= span
            elapsed = max(0.0, elapsed - lasts)
        if time > 0.0:
            yield time, None


def clamp(design: ModuleDesign, target: int, gain: float = 5.0, lasts: float = 1.0) -> Command:
    """A current gain (z_k - z) into the center; gain times time must exceed ln(2 (m - 1)) by some margin."""
    return Command(((lasts, CommandInput(np.zeros(len(design)), pull=gain, towards=float(design.targets[target]))),))


def excite(design: ModuleDesign, target: int, haste: float = 5.0) -> Command:
    """Excites the satellites below the target and inhibits the others, so that G is flat at its level.

    The center is sped up meanwhile to relax at the rate `haste`; on its own it would take 1 / decay. The target is met
    exactly without being known: it is what the module's own weights say.
    """
    level = np.where(np.arange(len(design)) < target, 1.0, -1.0) * 4.0 * design.thresholds[-1]
    lasts = np.log(20.0 * max(1, len(design) - 1)) / haste
    return Command(((lasts, CommandInput(level, haste=haste / design.decay)),))


def collapse_and_kick(design: ModuleDesign, target: int) -> Command:
    """Raises xi until one state is left, then kicks the center from there to the target; it forgets where it was."""
    kick = CommandInput(np.zeros(len(design)), kick=float(_kicks(design)[target]))
    return Command(((2.0, _collapse(design)), (1.0, kick)))


def _collapse(design: ModuleDesign) -> CommandInput:
    return CommandInput(np.zeros(len(design)), xi=5.0 / design.decay)


@lru_cache(maxsize=32)
def _kicks(design: ModuleDesign) -> Array:
    """The currents that carry the center from the collapsed state to each target in 1 unit of time, by bisection."""
    module = SwitchingModule(design)
    module.relax(_collapse(design), 2.0, 0.005)
    low, high = np.full(len(design), -2.0), design.targets + 2.0
    for _ in range(40):
        kick = 0.5 * (low + high)
        z, w = np.full(len(design), module.z), np.tile(module.w, (len(design), 1))
        for _ in range(100):
            z, w = advance_state(design, z, w, 0.01, CommandInput(np.zeros(len(design))), kick)
        reached = z >= design.targets
        low, high = np.where(reached, low, kick), np.where(reached, kick, high)
    return 0.5 * (low + high)


def advance_state(
    design: ModuleDesign, z: Array, w: Array, dt: float, drive: CommandInput | None = None, kick: Array | float = 0.0
) -> tuple[Array, Array]:
    """One exponential step of eqs 14 and 15: each decays exactly towards what drives it, stable for every dt.

    Args:
        z, w: shape (...,) and (..., m); many modules may be advanced at once.
        dt: module time.
        drive: the command.
        kick: added to the drive's, shape (...,).
    """
    if drive is None:
        drive = CommandInput(np.zeros(len(design)))
    goal = design.kappa * logistic(design.slope * z[..., None] - design.thresholds + drive.level)
    w_next = goal + (w - goal) * np.exp(-dt / design.kappa)
    rate = drive.haste * drive.xi * design.decay + drive.pull
    source = drive.haste * logistic(w_next @ design.weights / design.kappa - design.threshold)
    source = source + drive.pull * drive.towards + drive.kick + kick
    return source / rate + (z - source / rate) * np.exp(-rate * dt), w_next


class SwitchingModule:
    """A module in motion.

    Args:
        design: its constants.
        state: the motion it starts in, counted from 0.
        time_scale: s that one unit of module time takes.

    Attributes:
        z: of the center.
        w: of the satellites, shape (m,).
    """

    def __init__(self, design: ModuleDesign, state: int = 0, time_scale: float = 1.0) -> None:
        self.design, self.time_scale = design, time_scale
        self._command: Command | None = None
        self._elapsed = 0.0
        self.place(design.targets[state])

    @property
    def state(self) -> int:
        """The motion in whose range z lies."""
        return int(np.clip(np.floor(self.z - self.design.beta), 0, len(self.design) - 1))

    @property
    def commanded(self) -> bool:
        """Whether a command is still at work."""
        return self._command is not None

    def reset(self, state: int) -> None:
        """Puts the module to rest in a state."""
        self._command, self._elapsed = None, 0.0
        self.place(self.design.targets[state])

    def command(self, command: Command) -> None:
        """Starts a command in place of the one at work."""
        self._command, self._elapsed = command, 0.0

    def advance(self, dt: float, push: float = 0.0) -> None:
        """Goes dt seconds on; push is added to z afterwards (noise)."""
        time = dt / self.time_scale
        spans = self._command.spans(self._elapsed, time) if self._command is not None else ((time, None),)
        for span, drive in spans:
            self._z, self.w = advance_state(self.design, self._z, self.w, span, drive)
        self._z = self._z + push
        self._elapsed += time
        if self._command is not None and self._elapsed >= self._command.lasts:
            self._command = None

    def relax(self, drive: CommandInput, time: float, dt: float) -> None:
        """Holds a drive for some module time."""
        for _ in range(round(time / dt)):
            self._z, self.w = advance_state(self.design, self._z, self.w, dt, drive)

    @property
    def z(self) -> float:
        """The state of the center."""
        return float(self._z)

    def snapshot(self) -> tuple[Array, Array, Command | None, float]:
        """A copy of the state."""
        return self._z.copy(), self.w.copy(), self._command, self._elapsed

    def restore(self, snapshot: tuple[Array, Array, Command | None, float]) -> None:
        """Puts the state back to a snapshot."""
        z, w, self._command, self._elapsed = snapshot
        self._z, self.w = z.copy(), w.copy()

    def place(self, z: float) -> None:
        """Puts the center to z and the satellites to what belongs to it."""
        self._z = np.array(z)
        self.w = self.design.kappa * self.design.satellites(self._z)
