"""Quintics that begin and end without a jump: from 0 to 1, and from an initial value or slope to nothing."""

from __future__ import annotations

from typing import TypeVar

from controller.motion.rotations import Array

Share = TypeVar("Share", float, Array)


def rise(s: Share) -> Share:
    """How far one is at s in [0, 1] on the way from 0 to 1; it starts and ends with no slope and no curve."""
    return s**3 * (10.0 + s * (6.0 * s - 15.0))


def run_out(s: Share) -> tuple[Share, Share]:
    """What is left of an initial value and of an initial slope at s in [0, 1]; both end with no slope and no curve."""
    value = 1.0 + s**3 * (-10.0 + s * (15.0 - 6.0 * s))
    slope = s + s**3 * (-6.0 + s * (8.0 - 3.0 * s))
    return value, slope


def run_out_rates(s: Share) -> tuple[Share, Share]:
    """How fast both change there, per unit of s."""
    value = -30.0 * (s - s * s) ** 2
    slope = 1.0 + s**2 * (-18.0 + s * (32.0 - 15.0 * s))
    return value, slope
