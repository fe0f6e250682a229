"""The pace of a rig's joints: how far each may go now, eased while it is hot, strained or catching up."""

from __future__ import annotations

import numpy as np

from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array
from hardware.rig.supervision.catching_up import CatchingUp
from hardware.rig.supervision.easing import Easing
from hardware.rig.supervision.strain import Strain

_LONGEST_STEP = 2.0  # ticks' worth of way for an eased joint after a stall: the servo would take it at full speed


class JointPace:
    """The pace of J joints.

    Attributes:
        ease: of hot joints and a weak supply.
        strain: of joints that push against something.
        catching_up: which joints catch up with their targets.
    """

    def __init__(self, config: RigConfig, now: float) -> None:
        self.ease, self.strain, self.catching_up = Easing(config), Strain(config), CatchingUp(config)
        self._speed = np.array([joint.velocity for joint in config.joints])
        self._longest = _LONGEST_STEP / config.rate_hz
        self._last, self._passed = now, 0.0

    @property
    def part(self) -> Array:
        """The part of its speed limit that each joint may use now, shape (J,)."""
        return np.minimum(self.ease.part, self.catching_up.pace)

    @property
    def of_servos(self) -> Array:
        """The part that the servos themselves keep to: one whose goal turns back would hurry after it, shape (J,).

        One that yields must let go at once.
        """
        return np.where(self.strain.yielding, 1.0, self.catching_up.pace)

    def bound(self, targets: Array, positions: Array, now: float) -> tuple[Array, Array]:
        """The targets (J,), rad, near a joint that yields, and how far each joint may go since the last ones, rad."""
        self._passed = max(0.0, now - self._last)
        self._last = now
        strain, part = self.strain, self.ease.part
        if np.logical_or.reduce(self.catching_up.joints):
            part = self.part
        if np.logical_or.reduce(strain.yielding):
            near = np.clip(targets, positions - strain.reach, positions + strain.reach)
            targets = np.where(strain.yielding, near, targets)
            self.catching_up.joints |= strain.yielding
            part = np.where(strain.yielding, 1.0, self.part)
        eased_for = min(self._longest, self._passed)
        return targets, self._speed * part * np.where(part < 1.0, eased_for, self._passed)

    def sent(self, targets: Array, goals: Array, positions: Array) -> None:
        """Lets go of joints that have caught up: the targets, what was sent of them and what was measured, rad."""
        self.catching_up.note(targets, goals, positions, self.strain.yielding, self._passed, self._last)

    def start_again(self, now: float) -> None:
        """Has all joints catch up."""
        self._last = now
        self.catching_up.joints[:] = True
