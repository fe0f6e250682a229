"""Between the joints' angles and the servos' counts, for a whole rig at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hardware.rig import RigConfig

Array = NDArray[np.float64]


class RigScale:
    """The scales of a rig's J joints.

    Attributes:
        lower, upper: limits, shape (J,), rad.
        state_block: address and length of what `state` reads.
    """

    def __init__(self, config: RigConfig) -> None:
        joints = config.joints
        table = joints[0].table
        self.lower = np.array([joint.lower for joint in joints])
        self.upper = np.array([joint.upper for joint in joints])
        self._zero = np.array([joint.zero for joint in joints], dtype=np.float64)
        self._per_radian = np.array([joint.pulses_per_radian for joint in joints])
        self._direction = np.sign(self._per_radian)
        self._rad_per_s = table["present_velocity"].si
        self._ampere = table["present_current"].si
        self.state_block = table.block("present_current", "present_position")
        self._state_layout = table.dtype("present_current", "present_position")

    def pulses(self, angles: Array) -> Array:
        """The servo positions (J,), whole pulses, of joint angles (J,), rad."""
        return np.rint(self._zero + angles * self._per_radian)

    def state(self, joints: list[int], data: bytes) -> tuple[Array, Array, Array]:
        """Positions (rad), velocities (rad/s), currents (A) of some joints, from their state blocks one after another.

        Velocity and current are positive in the joint's own direction.
        """
        counts = np.frombuffer(data, dtype=self._state_layout)
        direction = self._direction[joints]
        return (
            (counts["present_position"] - self._zero[joints]) / self._per_radian[joints],
            counts["present_velocity"] * self._rad_per_s * direction,
            counts["present_current"] * self._ampere * direction,
        )
