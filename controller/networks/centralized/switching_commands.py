"""The commands of a switching module: three ways to bring it to a motion (Vakulenko et al. 2017)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from controller.motion.rotations import Array
from controller.networks.centralized.switching_design import ModuleDesign
from controller.networks.centralized.switching_module import Command, CommandInput, SwitchingModule, advance_state


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
