"""A robot on the deck: its joints and limits, the way poses are carried to them, its simulation and its rig."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from controller.deck.interfaces import JointLimits, Output, Retargeter
from controller.library.motion_library import MotionLibrary
from controller.loop.commands.interfaces import Pushable
from controller.loop.ensemble import RobotOutput
from controller.loop.output_channel import Channel
from controller.motion.rotations import Array
from motiondeck.run.robots.rig_output import open_rig

if TYPE_CHECKING:
    from sim.robots.robot import Robot
    from sim.robots.self_collision import CollisionGuard

FOLLOWER = "follower "
"""Goes before the names of a second robot's joints and outputs."""


class Stage(Output, Protocol):
    """The output that simulates a robot."""

    @property
    def qpos(self) -> Array:
        """MuJoCo's generalised positions."""
        ...

    @property
    def placed(self) -> Array:
        """Where the root is meant to be, position and quaternion, shape (7,), m."""
        ...

    @property
    def behind_s(self) -> float:
        """How far the body is behind what is written, s."""
        ...


@dataclass(frozen=True)
class RobotSetup:
    """Which robot plays, and how.

    Attributes:
        robot: the robot file.
        rig: the rig file, or None.
        emulated: whether the rig's servos are emulated.
        physics: whether the simulated robot moves by servos and masses, or exactly along its targets.
        root: what holds the simulated robot: gantry, fixed or free.
        balance: whether a free robot keeps its balance.
        walk: whether it walks on its own feet.
        solver: how motions are carried onto it, in place of what its file chooses.
        keep_apart: whether targets at which its limbs would collide are held back.
    """

    robot: Path
    rig: Path | None = None
    emulated: bool = False
    physics: bool = True
    root: str = "gantry"
    balance: bool = False
    walk: bool = False
    solver: str | None = None
    keep_apart: bool = False


@dataclass(frozen=True)
class Simulation:
    """How a robot is simulated.

    Attributes:
        robot: its model.
        stage: the output that simulates it.
        root, balance, walk: as in its `RobotSetup`.
    """

    robot: Robot
    stage: Stage
    root: str
    balance: bool
    walk: bool


@dataclass(frozen=True)
class RobotOnDeck:
    """Joints that a run drives.

    Attributes:
        name: of the robot or rig.
        own_joints: the names of its joints.
        limits: of a robot, narrowed to those of its rig.
        rest: where the joints end, shape (J,), rad, or None for where they stop.
        retarget: carries poses to its joints.
        rig: its servos, if it has any.
        simulation: None for a rig alone.
        prefix: goes before the names of its joints and outputs.
        guard: keeps its limbs apart, if that is wanted.
    """

    name: str
    own_joints: tuple[str, ...]
    limits: JointLimits
    rest: Array | None
    retarget: Retargeter
    rig: Channel | None
    simulation: Simulation | None = None
    prefix: str = ""
    guard: CollisionGuard | None = None

    @property
    def joints(self) -> list[str]:
        """The names of its joints, distinct from those of another robot."""
        return [self.prefix + joint for joint in self.own_joints]

    @property
    def pushable(self) -> Pushable | None:
        """Its simulation, where that has masses and nothing holds it fast."""
        if self.simulation is None or self.simulation.root == "fixed":
            return None
        stage = self.simulation.stage
        return stage if isinstance(stage, Pushable) else None

    @property
    def outputs(self) -> list[Channel]:
        """The rig before the simulation, because an approach starts from where the first output measures the joints."""
        stage = Channel(self.simulation.stage) if self.simulation is not None else None
        return [channel for channel in (self.rig, stage) if channel is not None]


def channels_of(robots: Sequence[RobotOnDeck]) -> list[Channel]:
    """The outputs of all robots; where there are several, each gets the targets of its own joints only."""
    channels: list[Channel] = []
    count, first = sum(len(robot.own_joints) for robot in robots), 0
    for robot in robots:
        for channel in robot.outputs:
            if len(robots) > 1:
                channel.output = RobotOutput(channel.output, first, len(robot.own_joints), count, robot.prefix)
            channels.append(channel)
        first += len(robot.own_joints)
    return channels


def open_robots(
    opening: ExitStack, setups: Sequence[RobotSetup], library: MotionLibrary, rate: float
) -> list[RobotOnDeck]:
    """Opens the robot that plays and, if there is a second one, the robot that mirrors it; see `open_robot`."""
    prefixes = ("", FOLLOWER)[: len(setups)]
    return [open_robot(opening, setup, library, rate, prefix) for setup, prefix in zip(setups, prefixes, strict=True)]


def open_robot(
    opening: ExitStack, setup: RobotSetup, library: MotionLibrary, rate: float, prefix: str = ""
) -> RobotOnDeck:
    """Opens a robot, its simulation and its rig for a loop of some rate (Hz); `opening` closes them.

    Raises:
        MotiondeckError: if a file is wrong or the rig cannot be connected; the message names it.
    """
    from sim.models.robot_file import solver_named
    from sim.physics.kinematic_playback import KinematicPlayback
    from sim.physics.playback import PhysicsPlayback
    from sim.robots.robot import load_robot
    from sim.robots.self_collision import CollisionGuard

    dt = 1.0 / rate
    robot = load_robot(setup.robot, library.skeleton, solver_named(setup.solver), dt)
    stage = KinematicPlayback(robot)
    if setup.physics:
        stage = PhysicsPlayback(robot, dt, setup.root, setup.balance, setup.walk)
    opening.callback(stage.close)
    rig, limits = None, robot.limits
    if setup.rig is not None:
        rig, limits = open_rig(opening, setup.rig, robot, rate, emulated=setup.emulated)
        opening.callback(rig.output.close)
    guard = CollisionGuard(replace(robot, limits=limits), dt) if setup.keep_apart else None
    retarget = guard or robot.retarget
    simulation = Simulation(robot, stage, setup.root, setup.balance, setup.walk)
    return RobotOnDeck(robot.name, robot.joints, limits, robot.rest, retarget, rig, simulation, prefix, guard)
