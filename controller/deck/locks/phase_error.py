"""From an error of the phase to a tempo: as fast as the tempo may change, without overshoot."""

from __future__ import annotations

import math

# Corrections of the tempo: at most this much, and 1/s for small errors.
MOST, STIFFNESS = 1.0, 5.0

# The share of the rate of the tempo that braking uses; the rest is left for what the reference itself does.
_SHARE = 0.8


def wrapped(phase: float, modulus: float = 1.0) -> float:
    """The same phase in [-modulus / 2, modulus / 2)."""
    return phase - modulus * math.floor(phase / modulus + 0.5)


def correction(error: float, rate: float) -> float:
    """By how much the tempo should differ from that of the reference.

    In proportion to small errors; to larger ones as the speed from which a constant deceleration b just ends at zero,
    joined to the line without a kink: the proximate time-optimal servomechanism (Franklin, Powell and Workman,
    "Digital Control of Dynamic Systems").

        v = k |e|                                 up to b / k^2
        v = sqrt(2 b (|e| - b / (2 k^2)))         beyond, at most MOST

    Args:
        error: how far the motion is behind its reference, s of the motion.
        rate: how fast the tempo may change, 1/s.
    """
    brake, size = _SHARE * rate, abs(error)
    linear = brake / STIFFNESS**2
    speed = STIFFNESS * size if size <= linear else math.sqrt(2.0 * brake * (size - 0.5 * linear))
    return math.copysign(min(speed, MOST), error)
