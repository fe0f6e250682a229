"""Conversion between joint angles and servo counts, for a whole rig at once."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.families.models import TRAITS
from hardware.families.table import ControlTable
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint

Array = NDArray[np.float64]


class RigScale:
    """The scales of a rig's J joints."""

    def __init__(self, config: RigConfig) -> None:
        joints = config.joints
        self.lower = np.array([joint.lower for joint in joints])  # limits, shape (J,), rad
        self.upper = np.array([joint.upper for joint in joints])  # limits, shape (J,), rad
        # Each servo's position at angle 0 as it counts now, shape (J,), pulses; see `whole_turns`.
        self.zero = np.array([joint.zero for joint in joints], dtype=np.float64)
        self._per_radian = np.array([joint.pulses_per_radian for joint in joints])
        # One count of velocity, shape (J,), rad/s; its sign is as that of `amperes`.
        self.rad_per_s = np.array([one.table["present_velocity"].si / (one.direction * one.gear) for one in joints])
        self._signs = np.array([_signs(joint) for joint in joints], dtype=np.int64).T
        # One count of current or load, shape (J,), A, negative where the servo turns the other way.
        self.amperes = np.array([joint.direction * _ampere(joint) for joint in joints])

    @property
    def ends(self) -> Array:
        """The lowest and the highest position of each servo, shape (2, J), whole pulses."""
        return np.sort([self.pulses(self.lower), self.pulses(self.upper)], axis=0)

    def within(self, angles: Array) -> Array:
        """Joint angles (J,), rad, those beyond a limit at the limit."""
        return np.minimum(np.maximum(angles, self.lower), self.upper)

    def pulses(self, angles: Array) -> Array:
        """The servo positions (J,), whole pulses, of joint angles (J,), rad."""
        return np.rint(self.zero + angles * self._per_radian)

    def motion(self, joints: NDArray[np.int64] | slice, counts: NDArray[Any]) -> tuple[Array, Array, Array]:
        """Positions (rad), velocities (rad/s) and currents (A) of some joints, from records with their counts.

        Velocity and current are positive in the joint's own direction.
        """
        velocity, force, position = counts["present_velocity"], counts["force"], counts["present_position"]
        if velocity.dtype.kind == "u":
            signs = self._signs[:, joints]
            velocity, force = _with_sign(velocity, signs[0]), _with_sign(force, signs[1])
            position = _with_sign(position, signs[2])
        return (
            (position - self.zero[joints]) / self._per_radian[joints],
            velocity * self.rad_per_s[joints],
            force * self.amperes[joints],
        )

    def angles(self, pulses: Array) -> Array:
        """The joint angles (J,), rad, at servo positions (J,), pulses."""
        return (pulses - self.zero) / self._per_radian


def _with_sign(counts: NDArray[Any], sign: NDArray[np.int64]) -> Array:
    """Counts whose sign is this bit (0 for none) as numbers."""
    size = (counts & (sign - 1)).astype(np.float64)
    return np.where(counts & sign, -size, size)


def force_of(table: ControlTable) -> str:
    """The register with a servo's current, or with its load where it measures none."""
    return "present_current" if "present_current" in table.registers else "present_load"


def _signs(joint: RigJoint) -> list[int]:
    """The bits that are the sign of velocity, force and position."""
    bits = [joint.table[name].sign_bit for name in ("present_velocity", force_of(joint.table), "present_position")]
    return [1 << bit if bit else 0 for bit in bits]


def _ampere(joint: RigJoint) -> float:
    """One count of a joint's current, A; of load, as a part of the stall current."""
    table = joint.table
    if "present_current" in table.registers:
        return table["present_current"].si or 0.0
    return TRAITS[joint.model].stall_current * 1e-3
