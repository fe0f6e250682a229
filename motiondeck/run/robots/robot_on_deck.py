"""A robot on the deck: its joints and limits, the way poses are carried to them, its simulation and its rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from controller.deck.interfaces import JointLimits, Retargeter
from controller.deck.live_values import Gains
from controller.library.motion_library import MotionLibrary
from controller.loop.commands.interfaces import Pushable
from controller.loop.output_channel import Channel
from controller.motion.clip import Clip
from controller.motion.rotations import Array
from controller.motion.skeleton import Skeleton
from motiondeck.run.spec.run_spec import EMULATED, RunSpec, is_emulated
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.shipped import find_rig
from sim.robots.catalogue import find_robot

if TYPE_CHECKING:
    from sim.physics.kinematic_playback import KinematicPlayback
    from sim.physics.playback import PhysicsPlayback
    from sim.robots.robot import Robot
    from sim.robots.self_collision import CollisionGuard

FOLLOWER = "follower "  # goes before the names of a second robot's joints and outputs


@dataclass(frozen=True)
class Simulation:
    """How a robot is simulated."""

    robot: Robot
    stage: KinematicPlayback | PhysicsPlayback
    root: str  # this and the next two are as in the `RunSpec`
    balance: bool
    walk: bool


@dataclass(frozen=True)
class RobotOnDeck:
    """Joints that a run drives."""

    name: str
    own_joints: tuple[str, ...]  # the names of its joints
    limits: JointLimits  # of a robot, narrowed to those of its rig
    rest: Array | None  # where the joints end, shape (J,), rad, or None for where they stop
    retarget: Retargeter  # carries poses to its joints
    rig: Channel | None
    simulation: Simulation  # of a rig alone its figure
    prefix: str = ""  # goes before the names of its joints and outputs
    guard: CollisionGuard | None = None  # keeps its limbs apart, if that is wanted
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])  # that layers play on
    gaze: Gains = field(default_factory=dict[str, tuple[float, float]])

    @property
    def without_layers(self) -> dict[str, str]:
        """Why, of each joint over which no layer can be played."""
        refused, why = self.joints, ""
        if self.guard is not None:
            why = "limbs are kept apart in one motion, not in layers over it: leave --check-collisions"
        elif self.simulation.walk:
            from sim.physics.walk_trial import leg_joints

            robot, trunk = self.simulation.robot, self.groups.get("trunk", ())
            carry = [leg or one in trunk for leg, one in zip(leg_joints(robot), robot.joints, strict=True)]
            refused = [joint for joint, carries in zip(refused, carry, strict=True) if carries]
            why = "legs and trunk carry a robot walking on its own feet: layers and live values move its arms and head"
        elif self.simulation.root == "free":
            why = "a layer moves the weight of a robot on its own feet, which only --walk plans for: no layers here"
        return dict.fromkeys(refused, why) if why else {}

    @property
    def joints(self) -> list[str]:
        """The names of its joints, distinct from those of another robot."""
        return [self.prefix + joint for joint in self.own_joints]

    @property
    def pushable(self) -> Pushable | None:
        """Its simulation, where that has masses and nothing holds it fast."""
        stage = self.simulation.stage
        return stage if self.simulation.root != "fixed" and isinstance(stage, Pushable) else None


def channels_of(robots: Sequence[RobotOnDeck]) -> list[Channel]:
    """The outputs of all robots; of several, each gets only the targets of its joints."""
    channels: list[Channel] = []
    count, first = sum(len(robot.own_joints) for robot in robots), 0
    for robot in robots:
        # The rig goes first, because an approach starts from where the first output measures the joints.
        for channel in filter(None, (robot.rig, Channel(robot.simulation.stage))):
            if len(robots) > 1:
                channel.share(first, len(robot.own_joints), count, robot.prefix)
            channels.append(channel)
        first += len(robot.own_joints)
    return channels


def with_robot(spec: RunSpec, skeleton: Skeleton) -> RunSpec:
    """The spec with a robot: the given one, that with the rig's name, or the mannequin; None is a rig alone.

    MotiondeckError if motions of bodies are for a rig whose robot is not known.
    """
    rig = spec.rig_named
    if spec.robot is not None or (skeleton.is_rig and rig not in ("", EMULATED)):
        return spec
    robot = "mannequin" if rig in ("", EMULATED) else find_rig(rig, also=(EMULATED,)).stem
    try:
        find_robot(robot)
    except UnknownNameError:
        raise MotiondeckError(
            f"{rig}: motions of bodies need a robot with its joints (--robot); --library FILE plays what it was taught"
        ) from None
    return replace(spec, robot=robot)


def open_robots(
    opening: ExitStack, spec: RunSpec, source: MotionLibrary | Clip, first: Path | None = None
) -> list[RobotOnDeck]:
    """Opens the robot of a run and, if there is a second one, the robot that mirrors it; see `open_robot`."""
    robots = [open_robot(opening, with_robot(spec, source.skeleton), source, first=first)]
    if spec.follow is not None:
        second = replace(spec, robot=spec.follow, rig=spec.follow_rig, solver=None)
        robots.append(open_robot(opening, second, source, FOLLOWER))
    return robots


def open_robot(
    opening: ExitStack, spec: RunSpec, source: MotionLibrary | Clip, prefix: str = "", first: Path | None = None
) -> RobotOnDeck:
    """Opens robot, simulation and rig of a run, closed by `opening`; MotiondeckError if one cannot be opened.

    `first` is the file that the first motion was learned from.
    """
    if spec.robot is None and spec.rig is not None:
        from motiondeck.run.robots.rig_on_deck import open_rig_alone

        robot, rest, rig, figure, groups, gaze = open_rig_alone(opening, spec, find_rig(spec.rig_named), source)
        own = robot.joints, robot.limits, rest, robot.retarget, rig, Simulation(robot, figure, "fixed", False, False)
        return RobotOnDeck(robot.name, *own, prefix, groups=groups, gaze=gaze)
    from sim.models.robot_file import read_robot_file, solver_named
    from sim.physics.feedback import Feedback
    from sim.physics.kinematic_playback import KinematicPlayback
    from sim.physics.playback import PhysicsPlayback
    from sim.robots.joint_groups import gaze_gains, joint_groups
    from sim.robots.robot import load_robot
    from sim.robots.self_collision import CollisionGuard

    dt = 1.0 / spec.rate
    file, rig_file = robot_files(spec)
    guard = None
    if rig_file is not None:
        from motiondeck.run.guard.guarded_rig import guard_process

        guard = opening.enter_context(guard_process())  # it gets ready while the robot is loaded
    robot = load_robot(file, source.skeleton, solver_named(spec.solver), dt)
    stage = KinematicPlayback(robot)
    if spec.walk:
        from motiondeck.run.robots.walk_choice import able_to_walk

        robot = able_to_walk(robot, file)
    if spec.physics:
        alone = first if spec.root == "free" and not (spec.balance or spec.walk) else None
        feedback = Feedback.beside(alone, robot) if alone is not None else None
        stage = PhysicsPlayback(robot, dt, spec.root, spec.balance, spec.walk, feedback=feedback)
    opening.callback(stage.close)
    rig, limits = None, robot.limits
    if rig_file is not None and guard is not None:
        from motiondeck.run.robots.rig_output import open_rig

        rig, limits = open_rig(opening, guard, rig_file, robot, spec.rate, emulated=is_emulated(spec.rig))
    apart = CollisionGuard(replace(robot, limits=limits), dt) if spec.check_collisions else None
    retarget = apart or robot.retarget
    simulation = Simulation(robot, stage, spec.root, spec.balance, spec.walk)
    groups = joint_groups(robot, read_robot_file(file), source.skeleton)
    own = robot.joints, limits, robot.rest, retarget, rig, simulation
    return RobotOnDeck(robot.name, *own, prefix, apart, groups, gaze_gains(robot, groups))


def robot_files(spec: RunSpec) -> tuple[Path, Path | None]:
    """The files of the robot and of its rig; for emulated servos the rig with the robot's name, or the one named.

    MotiondeckError if there is no such robot or rig; it names the nearest.
    """
    file, name = find_robot(str(spec.robot)), Path(str(spec.robot)).stem
    if spec.rig is None:
        return file, None
    if spec.rig_named != EMULATED:
        return file, find_rig(spec.rig_named, also=() if is_emulated(spec.rig) else (EMULATED,))
    try:
        return file, find_rig(name)
    except MotiondeckError:
        raise MotiondeckError(
            f"there is no rig for robot '{name}' to be emulated. Try: --rig emulated --robot servo20. "
            "For your own robot write a rig file, emulate it with motiondeck rig emulate, and name it with --rig FILE"
        ) from None
