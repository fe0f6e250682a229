"""What the deck asks of its neighbours: a robot's joints, a way onto it, and the outputs that receive the targets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from controller.mocap.posture import Pose
from controller.rotations import Array


@dataclass(frozen=True)
class JointLimits:
    """What each of J joints may do at most.

    Attributes:
        lower, upper: position, shape (J,), rad.
        velocity: shape (J,), rad/s, > 0.
        acceleration: shape (J,), rad/s^2, > 0.
        jerk: shape (J,), rad/s^3, > 0.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    jerk: Array


@dataclass(slots=True)
class PlacedPose(Pose):
    """A pose of which it is known where the robot's own root was meant to be with it.

    Attributes:
        robot_root: position, m, and quaternion, shape (7,).
    """

    robot_root: Array


class Retargeter(Protocol):
    """Carries the pose of a human skeleton to the joints of one robot."""

    def __call__(self, pose: Pose) -> Array:
        """Joint targets, shape (J,), rad; they need not obey the limits. The caller copies what it keeps."""
        ...


class Output(Protocol):
    """Something that is given joint targets and may answer with measured positions.

    A write may raise: the loop counts the fault and parks the output, and the others go on.
    """

    name: str

    def write(self, targets: Array, pose: Pose) -> None:
        """Takes the targets (J,), rad, of this tick, and the pose they come from (for its root)."""
        ...

    def measured(self) -> Array | None:
        """The latest measured joint positions (J,), rad, or None where nothing is measured yet."""
        ...

    def report(self) -> Mapping[str, object]:
        """What `play --json` says about this output: plain numbers, strings and lists."""
        ...

    def close(self) -> None:
        """Leaves the hardware in its safe state; may be called twice."""
        ...
