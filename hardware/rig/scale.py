"""Between the joints' angles and the servos' counts, for a whole rig at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hardware.control_table.servo_traits import TRAITS
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.state_block import StateBlock

Array = NDArray[np.float64]


class RigState(NamedTuple):
    """What some joints measured, each of shape (n,), or a mere 0-length array where the block holds no such thing.

    Attributes:
        positions: rad.
        velocities: rad/s.
        currents: A.
        temperatures: degC.
        errors: hardware error bits.
        torque: whether torque is on.
    """

    positions: Array
    velocities: Array
    currents: Array
    temperatures: Array
    errors: NDArray[np.int64]
    torque: NDArray[np.bool_]


class RigScale:
    """The scales of a rig's J joints.

    Attributes:
        lower, upper: limits, shape (J,), rad.
        rad_per_s: what one count of velocity means, shape (J,), rad/s; its sign is as that of `amperes`.
        amperes: what one count of current or load means, shape (J,), A, negative where the servo turns the other way.
        block: what `state` reads.
    """

    def __init__(self, config: RigConfig) -> None:
        joints = config.joints
        self.lower = np.array([joint.lower for joint in joints])
        self.upper = np.array([joint.upper for joint in joints])
        self._zero = np.array([joint.zero for joint in joints], dtype=np.float64)
        self._per_radian = np.array([joint.pulses_per_radian for joint in joints])
        self.rad_per_s = np.array(
            [joint.table["present_velocity"].si / (joint.direction * joint.gear) for joint in joints]
        )
        self.amperes = np.array([joint.direction * _ampere(joint) for joint in joints])
        self.block = StateBlock([joint.table for joint in joints])

    @property
    def state_block(self) -> tuple[int, int]:
        """Address and length of what `state` reads."""
        return self.block.address, self.block.length

    def pulses(self, angles: Array) -> Array:
        """The servo positions (J,), whole pulses, of joint angles (J,), rad."""
        return np.rint(self._zero + angles * self._per_radian)

    def state(self, joints: list[int], data: bytes) -> RigState:
        """What some joints measured, from their state blocks one after another.

        Velocity and current are positive in the joint's own direction.
        """
        counts = np.frombuffer(data, dtype=self.block.layout)
        healthy = "torque_enable" in (self.block.layout.names or ())
        return RigState(
            (counts["present_position"] - self._zero[joints]) / self._per_radian[joints],
            counts["present_velocity"] * self.rad_per_s[joints],
            counts["force"] * self.amperes[joints],
            counts["present_temperature"].astype(np.float64) if healthy else np.empty(0),
            counts["hardware_error_status"].astype(np.int64) if healthy else np.empty(0, dtype=np.int64),
            counts["torque_enable"] != 0 if healthy else np.empty(0, dtype=np.bool_),
        )


def _ampere(joint: RigJoint) -> float:
    """What one count of a joint's current is, A; a model that measures load only is asked for its stall current."""
    table = joint.table
    if "present_current" in table.registers:
        return table["present_current"].si or 0.0
    traits = TRAITS.get(joint.model)
    return traits.stall_current * 1e-3 if traits is not None else 0.0
