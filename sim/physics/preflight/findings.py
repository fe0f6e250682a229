"""Findings of a preflight, the verdict on a motion, and the setup that is judged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.motion.rotations import Array


@dataclass(frozen=True)
class Finding:
    """One number of a preflight."""

    check: str
    value: float
    limit: float | None  # the largest value that passes; None if the number only informs
    unit: str
    where: str = ""  # the joint or the bodies concerned, or ""
    ok: bool = True  # whether it is within its limit
    cause: str = ""  # of a failure even at the slowest tempo, or ""


@dataclass(frozen=True)
class PreflightVerdict:
    """The findings about one motion or switch."""

    name: str
    findings: tuple[Finding, ...]
    passes_at: float | None  # the largest passing tempo, up to the judged one; None if no tempo passes
    way: tuple[str, ...] = ()  # the intermediate motions of a switch that is judged by its parts
    obstacles: tuple[Finding, ...] = ()  # if no tempo passes, the findings that fail even at the slowest

    @property
    def ok(self) -> bool:
        """Whether all findings pass."""
        return all(finding.ok for finding in self.findings)

    @property
    def troubles(self) -> tuple[Finding, ...]:
        """The findings beyond their limits."""
        return tuple(finding for finding in self.findings if not finding.ok)


def limited(check: str, value: float, limit: float, unit: str, where: str = "") -> Finding:
    """A finding that is within its limit or not."""
    return Finding(check, value, limit, unit, where, ok=value <= limit)


def of_joints(check: str, values: Array, limit: float | None, unit: str, joints: tuple[str, ...]) -> Finding:
    """The largest of the values of all joints, shape (J,), with the joint."""
    worst = int(np.argmax(values))
    value = float(values[worst])
    return Finding(check, value, limit, unit, joints[worst], ok=limit is None or value <= limit)
