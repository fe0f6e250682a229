"""Quintic easing: from 0 to 1, and from an initial value or slope to 0, with zero end slopes and curvatures."""

from typing import TypeVar

from controller.motion.rotations import Array

Share = TypeVar("Share", float, Array)


def rise(s: Share) -> Share:
    """From 0 to 1 for s in [0, 1]; slope and curvature are 0 at both ends."""
    return s**3 * (10.0 + s * (6.0 * s - 15.0))


def run_out(s: Share) -> tuple[Share, Share]:
    """The remaining shares of an initial value and of an initial slope at s in [0, 1]; slope and curvature end at 0."""
    value = 1.0 + s**3 * (-10.0 + s * (15.0 - 6.0 * s))
    slope = s + s**3 * (-6.0 + s * (8.0 - 3.0 * s))
    return value, slope


def run_out_rates(s: Share) -> tuple[Share, Share]:
    """The derivatives of `run_out` by s."""
    value = -30.0 * (s - s * s) ** 2
    slope = 1.0 + s**2 * (-18.0 + s * (32.0 - 15.0 * s))
    return value, slope
