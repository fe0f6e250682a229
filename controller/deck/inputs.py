"""Inputs besides the phase, such as speed: they follow the commanded values at a bounded rate."""

from __future__ import annotations

import math
from collections.abc import Mapping

from motiondeck_base.errors import MotiondeckError, UnknownNameError

ACROSS_SECONDS = 1.0  # how long an input takes from one end of what was learned to the other


class Inputs:
    """The inputs of a library's motions.

    Args:
        ranges: their names, and between which values each was learned.
        usual: the value that each has at the beginning.

    Attributes:
        present: their present values.
    """

    def __init__(self, ranges: Mapping[str, tuple[float, float]], usual: Mapping[str, float]) -> None:
        self._ranges, self._commanded = dict(ranges), dict(usual)
        self.present = dict(usual)

    def command(self, name: str, value: float) -> None:
        """Changes an input to another value.

        Raises:
            UnknownNameError: if no motion of the library has such an input.
            MotiondeckError: if the value lies outside of what was learned.
        """
        if not self._ranges:
            raise UnknownNameError(f"there is no input '{name}': no motion of this library was learned with one")
        if name not in self._ranges:
            raise UnknownNameError.among("input", name, self._ranges)
        least, most = self._ranges[name]
        if not (math.isfinite(value) and least <= value <= most):
            raise MotiondeckError(f"{name} was learned from {least:.3g} to {most:.3g}; {value:g} is not in between")
        self._commanded[name] = value

    def advance(self, dt: float) -> dict[str, float]:
        """Goes dt seconds on; the inputs that have changed, with their present values."""
        changed = {}
        for name, goal in self._commanded.items():
            present = self.present[name]
            if goal != present:
                least, most = self._ranges[name]
                step = (most - least) * dt / ACROSS_SECONDS
                self.present[name] = changed[name] = present + min(max(goal - present, -step), step)
        return changed
