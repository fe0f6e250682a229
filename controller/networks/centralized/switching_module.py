"""A switching module in motion (eqs 14 and 15 of `switching_design`), and three commands that bring it to a motion."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from controller.motion.rotations import Array
from controller.networks.centralized.satellites import logistic
from controller.networks.centralized.switching_design import ModuleDesign


@dataclass(slots=True)
class CommandInput:
    """The terms that a command adds to eqs 14 and 15 for a while; all zero without a command."""

    level: Array  # added to the argument of each satellite, shape (m,)
    pull: float = 0.0  # adds pull (towards - z) to z': a clamp current
    towards: float = 0.0
    haste: float = 1.0  # multiplies the right side of eq. 15
    xi: float = 1.0  # multiplies xi
    kick: float = 0.0  # added to z'


@dataclass(frozen=True, eq=False)
class Command:
    """A switch to one motion: drives one after another, each for some module time."""

    phases: tuple[tuple[float, CommandInput], ...]

    @property
    def lasts(self) -> float:
        """In module time."""
        return sum(time for time, _ in self.phases)

    def spans(self, elapsed: float, time: float) -> Iterator[tuple[float, CommandInput | None]]:
        """The pieces of module time in a step, each with its drive, None after the end."""
        # A step is cut where a drive ends: a kick that lasts a step too long reaches the next state.
        for lasts, drive in self.phases:
            span = min(time, lasts - elapsed)
            if span > 0.0:
                yield span, drive
                time -= span
            elapsed = max(0.0, elapsed - lasts)
        if time > 0.0:
            yield time, None


def advance_state(
    design: ModuleDesign, z: Array, w: Array, dt: float, drive: CommandInput | None = None, kick: Array | float = 0.0
) -> tuple[Array, Array]:
    """One exponential step of eqs 14 and 15: each decays exactly towards what drives it, stable for every dt.

    For modules with z of shape (...,) and w (..., m), dt in module time; `kick` is added to the drive's, shape (...,).
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
    """A module in motion, from a `state` on, counted from 0; one unit of its time takes `time_scale` s."""

    def __init__(self, design: ModuleDesign, state: int = 0, time_scale: float = 1.0) -> None:
        self.design, self.time_scale = design, time_scale
        self.reset(state)

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
        self._command: Command | None = None
        self._elapsed = 0.0
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
    one, own = np.array(design.targets[0]), design.kappa * design.satellites(design.targets[0])
    for _ in range(400):
        one, own = advance_state(design, one, own, 0.005, _collapse(design))
    low, high = np.full(len(design), -2.0), design.targets + 2.0
    for _ in range(40):
        kick = 0.5 * (low + high)
        z, w = np.full(len(design), one), np.tile(own, (len(design), 1))
        for _ in range(100):
            z, w = advance_state(design, z, w, 0.01, CommandInput(np.zeros(len(design))), kick)
        reached = z >= design.targets
        low, high = np.where(reached, low, kick), np.where(reached, kick, high)
    return 0.5 * (low + high)
