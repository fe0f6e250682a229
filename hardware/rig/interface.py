"""The interface of every rig: servos on a port, emulated ones, or simulated ones without bytes."""

from __future__ import annotations

from typing import Protocol

from hardware.rig.faults import RigFaults
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array


class Rig(Protocol):
    """A rig that is switched on; arrays follow the order of the rig file's joints.

    `DynamixelRig`, `SupervisedRig`, `JoinedRig` and `SimulatedRig` fit it.
    """

    config: RigConfig
    names: tuple[str, ...]

    @property
    def positions(self) -> Array:
        """Last measured, shape (J,), rad."""
        ...

    @property
    def velocities(self) -> Array:
        """Last measured, shape (J,), rad/s."""
        ...

    @property
    def currents(self) -> Array:
        """Last measured, shape (J,), A."""
        ...

    @property
    def faults(self) -> RigFaults:
        """What went wrong so far."""
        ...

    def write(self, targets: Array) -> None:
        """Sends the targets (J,), rad, and asks the joints for their state, without waiting."""
        ...

    def request_state(self) -> None:
        """Asks the joints for their state without giving them targets, and without waiting."""
        ...

    def collect_state(self) -> bool:
        """Takes the answer if it has come in the meantime; whether anything new was measured."""
        ...

    def close(self) -> list[str]:
        """Ends it; the joints that did not confirm it."""
        ...
