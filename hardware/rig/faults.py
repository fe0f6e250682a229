"""What went wrong on a rig, counted a joint: a fault in the loop is a number here and never an exception."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

Counts = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class RigFaults:
    """Counts since the rig was switched on, each of shape (J,).

    Attributes:
        missed: replies that did not come.
        corrupt: replies with a bad checksum.
        alert: replies in which the servo reported a hardware problem.
        clipped: targets moved back to a limit of the rig file.
        refused: targets that were NaN or infinite; the joint kept its last goal.
        unsent: targets that the port would not take, or that came after the watchdogs had stopped the servos.
    """

    missed: Counts
    corrupt: Counts
    alert: Counts
    clipped: Counts
    refused: Counts
    unsent: Counts

    @classmethod
    def none(cls, joints: int) -> RigFaults:
        """No faults yet."""
        return cls(*(np.zeros(joints, dtype=np.int64) for _ in fields(cls)))

    @property
    def total(self) -> int:
        """The sum of all but `clipped`, which is the caller's doing and not the rig's."""
        return sum(int(counts.sum()) for kind, counts in self._kinds() if kind != "clipped")

    def by_joint(self, names: Sequence[str]) -> dict[str, dict[str, int]]:
        """The counts that are not zero: joint name, then kind, then count."""
        found: dict[str, dict[str, int]] = {}
        for kind, counts in self._kinds():
            for index in np.flatnonzero(counts).tolist():
                found.setdefault(names[index], {})[kind] = int(counts[index])
        return found

    def _kinds(self) -> list[tuple[str, Counts]]:
        return [(field.name, getattr(self, field.name)) for field in fields(self)]
