"""The interfaces of the deck to its neighbours: joint limits, retargeting, and the outputs that receive targets."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from controller.wire.messages.commands import Side

__all__ = ["JointLimits", "Output", "PlacedPose", "Retargeter", "Side"]


@dataclass(frozen=True)
class JointLimits:
    """The limits of J joints."""

    lower: Array  # position, shape (J,), rad
    upper: Array  # position, shape (J,), rad
    velocity: Array  # shape (J,), rad/s, > 0
    acceleration: Array  # shape (J,), rad/s^2, > 0
    jerk: Array  # shape (J,), rad/s^3, > 0


@dataclass(slots=True)
class PlacedPose(Pose):
    """A pose with the place that the robot's own root was meant to have in it."""

    robot_root: Array  # position, m, and quaternion, shape (7,)


Retargeter = Callable[[Pose], Array]
"""Carries the pose of a human skeleton to the joints of one robot: targets, shape (J,), rad, which need not obey its
limits. The caller copies what it keeps."""


class Output(Protocol):
    """A receiver of joint targets that may measure positions; one that raises is counted, and parked by the loop."""

    name: str

    def write(self, targets: Array, pose: Pose) -> None:
        """Writes the targets (J,), rad, of this tick; `pose` is the one they come from (for its root)."""

    def measured(self) -> Array | None:
        """The latest measured joint positions (J,), rad, or None before the first measurement."""
        ...

    def report(self) -> Mapping[str, object]:
        """The entry of this output in `play --json`: plain numbers, strings and lists."""
        ...

    def close(self) -> None:
        """Leaves the hardware in its safe state; may be called twice."""
