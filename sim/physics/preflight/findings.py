"""Findings of a preflight: numbers with their limits, and the verdict that they lead to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.motion.rotations import Array


@dataclass(frozen=True)
class Finding:
    """One number of a preflight.

    Attributes:
        check: its name.
        value: in the unit.
        limit: the largest value that passes; None if the number only informs.
        unit: of both.
        where: the joint or the bodies concerned, or "".
        ok: whether it is within its limit.
        cause: why it fails even at the slowest tempo, in words, or "".
    """

    check: str
    value: float
    limit: float | None
    unit: str
    where: str = ""
    ok: bool = True
    cause: str = ""


@dataclass(frozen=True)
class PreflightVerdict:
    """The findings about one motion or switch.

    Attributes:
        name: of the motion or switch.
        findings: all of them.
        passes_at: the largest tempo, up to the judged one, at which all passes; None if no slower tempo helps.
        by_way_of: the motions on the way of a switch that is not direct; it is judged by its parts.
        obstacles: where no tempo passes, the findings that fail even at the slowest.
    """

    name: str
    findings: tuple[Finding, ...]
    passes_at: float | None
    by_way_of: tuple[str, ...] = ()
    obstacles: tuple[Finding, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the robot can play it."""
        return all(finding.ok for finding in self.findings)

    @property
    def troubles(self) -> tuple[Finding, ...]:
        """The findings beyond their limits."""
        return tuple(finding for finding in self.findings if not finding.ok)


def limited(check: str, value: float, limit: float, unit: str, where: str = "") -> Finding:
    """A finding that is within its limit or not."""
    return Finding(check, value, limit, unit, where, ok=value <= limit)


def of_joints(check: str, values: Array, limit: float | None, unit: str, joints: tuple[str, ...]) -> Finding:
    """The largest of the values of all joints, shape (J,), and whose it is."""
    worst = int(np.argmax(values))
    value = float(values[worst])
    return Finding(check, value, limit, unit, joints[worst], ok=limit is None or value <= limit)
