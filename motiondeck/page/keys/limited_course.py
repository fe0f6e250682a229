"""What a rig's limits make of a motion: where its joints go then, and where a limit holds one back."""

from collections.abc import Sequence

import numpy as np

from controller.deck.interfaces import JointLimits
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.rotations import Array

NOTED = np.radians(0.5)  # of what is held back


HeldBack = tuple[float, float, str]
"""From when to when, s, a joint is held back, and in words which one, by how much, and by which limit."""


def limited_course(
    joints: Sequence[str], wanted: Array, rate: float, limits: JointLimits, *, loop: bool
) -> tuple[Array, list[HeldBack]]:
    """Where joints go, shape (T, J), rad, that shall go as `wanted` (T, J), at a rate, Hz; a loop in its second round.

    What is within the limits comes out as it is.
    """
    envelope = SafetyEnvelope(limits, 1.0 / rate)
    envelope.start(np.clip(wanted[0], limits.lower, limits.upper))
    rounds = [np.array([envelope(targets).copy() for targets in wanted[begin:]]) for begin in ([0, 1] if loop else [0])]
    course = np.concatenate([rounds[0][-1:], rounds[1]]) if loop else rounds[0]
    off = np.abs(course - wanted)
    speed = np.abs(np.gradient(wanted, 1.0 / rate, axis=0))
    found: list[HeldBack] = []
    for index in np.flatnonzero(off.max(axis=0) > NOTED).tolist():
        at = np.flatnonzero(off[:, index] > NOTED)
        here, values, fastest = off[:, index], wanted[:, index], speed[:, index].max()
        low, high, allowed = limits.lower[index], limits.upper[index], limits.velocity[index]
        if values.min() < low - NOTED or values.max() > high + NOTED:
            ends = np.degrees((values.min(), values.max(), low, high))
            why = "it goes from {:.0f} to {:.0f}°, and may {:.0f} to {:.0f}°".format(*ends)
        elif fastest > allowed:
            why = f"it turns at {np.degrees(fastest):.0f}°/s, and may {np.degrees(allowed):.0f}°/s"
        else:
            why = "it speeds up faster than it may"
        text = f"{joints[index]} is held back by up to {np.degrees(here.max()):.1f}°: {why}"
        found.append((float(at[0] / rate), float(at[-1] / rate), text))
    return course, found
