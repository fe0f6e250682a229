"""A body on the deck: one robot, the stage where it is simulated, and its rig, if it has one."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from controller.cli.session.rig_output import open_rig
from controller.deck.interfaces import JointLimits, Output, Retargeter
from controller.library.motion_library import MotionLibrary
from controller.loop.ensemble import Share
from controller.loop.output_channel import Channel
from controller.rotations import Array

if TYPE_CHECKING:
    from sim.robots.collision_guard import CollisionGuard
    from sim.robots.robot import Robot

FOLLOWER = "follower "
"""Goes before the names of a second robot's joints and outputs."""


class Stage(Output, Protocol):
    """Where a robot is simulated."""

    @property
    def qpos(self) -> Array:
        """MuJoCo's generalised positions."""
        ...

    @property
    def placed(self) -> Array:
        """Where the root is meant to be, position and quaternion, shape (7,), m."""
        ...


@dataclass(frozen=True)
class RobotSetup:
    """Who plays.

    Attributes:
        robot: the robot file.
        rig: the rig file, or None.
        emulated: whether the rig's servos are emulated.
        root: what holds the simulated robot: gantry, fixed or free.
        balance: whether a free robot keeps its balance.
        solver: how motions are carried onto it, in place of what its file says.
        apart: whether targets in which it would run into itself are held back.
    """

    robot: Path
    rig: Path | None = None
    emulated: bool = False
    root: str = "gantry"
    balance: bool = False
    solver: str | None = None
    apart: bool = False


@dataclass(frozen=True)
class RobotOnDeck:
    """A robot that has been opened.

    Attributes:
        robot: itself.
        limits: its own, narrowed to its rig's.
        stage: where it is simulated.
        rig: its servos, if it has any.
        called: what goes before the names of its joints and outputs.
        guard: keeps its limbs apart, if that was asked for.
    """

    robot: Robot
    limits: JointLimits
    stage: Stage
    rig: Channel | None
    called: str = ""
    guard: CollisionGuard | None = None

    @property
    def retarget(self) -> Retargeter:
        """From the skeleton's poses to its joints."""
        return self.guard or self.robot.retarget

    @property
    def joints(self) -> list[str]:
        """The names of its joints, which tell it from other bodies."""
        return [self.called + joint for joint in self.robot.joints]

    @staticmethod
    def channels_of(bodies: Sequence[RobotOnDeck]) -> list[Channel]:
        """The outputs of all bodies; a rig before the stage, for an approach starts from where its joints are."""
        channels: list[Channel] = []
        count, first = sum(len(body.joints) for body in bodies), 0
        for body in bodies:
            for channel in [*([body.rig] if body.rig is not None else []), Channel(body.stage)]:
                if len(bodies) > 1:
                    channel.output = Share(channel.output, first, len(body.joints), count, body.called)
                channels.append(channel)
            first += len(body.joints)
        return channels


def open_body(
    opening: ExitStack, cast: RobotSetup, library: MotionLibrary, rate: float, *, physics: bool, called: str = ""
) -> RobotOnDeck:
    """Opens a robot, its stage and its rig for a loop of some rate (Hz); `opening` closes them.

    Raises:
        MotiondeckError: if a file is wrong or the rig cannot be connected; the message names it.
    """
    from sim.models.robot_file import solver_named
    from sim.physics.playback import KinematicPlayback, PhysicsPlayback
    from sim.robots.collision_guard import CollisionGuard
    from sim.robots.robot import load_robot

    robot = load_robot(cast.robot, library.skeleton, solver_named(cast.solver), 1.0 / rate)
    stage = PhysicsPlayback(robot, 1.0 / rate, cast.root, cast.balance) if physics else KinematicPlayback(robot)
    opening.callback(stage.close)
    rig, limits = None, robot.limits
    if cast.rig is not None:
        rig, limits = open_rig(opening, cast.rig, robot, rate, emulated=cast.emulated)
        opening.callback(rig.output.close)
    guard = CollisionGuard(replace(robot, limits=limits), 1.0 / rate) if cast.apart else None
    return RobotOnDeck(robot, limits, stage, rig, called, guard)
