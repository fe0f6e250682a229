"""A rig on the deck without a simulated robot: it plays what it was taught, or human motions as a robot would."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import numpy as np

from controller.deck.interfaces import JointLimits, Retargeter
from controller.deck.recorded_deck import RecordedDeck
from controller.library.motion_library import MotionLibrary
from controller.loop.output_channel import Channel
from controller.motion.clip import Clip
from controller.motion.encodings.joint_angles import JointRetargeter
from controller.motion.posture import Pose
from controller.motion.rotations import Array
from controller.wire.run_recording import RunRecording
from motiondeck.run.guard.guarded_rig import guard_process
from motiondeck.run.robots.rig_output import connect_rig, narrowed
from motiondeck.run.robots.robot_on_deck import RobotOnDeck
from motiondeck_base.errors import MotiondeckError, UnknownNameError

if TYPE_CHECKING:
    from hardware.rig.rig_file import RigConfig

# What a joint may do whose acceleration the rig file leaves open, rad/s^2; the jerk brings it there in 20 ms.
_ACCELERATION = 80.0
_RISE = 0.02  # s


def open_rig_alone(
    opening: ExitStack, config: RigConfig, ports: list[str], source: Clip | MotionLibrary, robot: str
) -> RobotOnDeck:
    """Connects a rig, at other ports if given, whose joints follow a taught clip or a library; `opening` closes it.

    Taught joints are driven by their names; the others stay where they are. Human motions need the robot file whose
    joints the rig has. MotiondeckError if the source does not fit the rig (before anything is switched on), or it
    cannot be connected.
    """
    if source.skeleton.is_rig:
        return _open_taught(opening, config, ports, source)
    if isinstance(source, Clip):
        raise MotiondeckError(f"clip '{source.name}' shows a human body. Learn it first: motiondeck learn")
    from sim.robots.catalogue import find_robot
    from sim.robots.robot import load_robot

    try:
        file = find_robot(robot)
    except UnknownNameError as error:
        raise MotiondeckError(
            f"{error} Motions of people are carried to the rig by a robot with its joints: name it with --robot."
        ) from None
    guard = opening.enter_context(guard_process())
    loaded = load_robot(file, source.skeleton)
    limits = narrowed(loaded.limits, loaded, config)
    output = connect_rig(opening, guard, config, ports, loaded.joints, limits)
    return RobotOnDeck(loaded.name, loaded.joints, limits, loaded.rest, loaded.retarget, Channel(output))


def _open_taught(opening: ExitStack, config: RigConfig, ports: list[str], source: Clip | MotionLibrary) -> RobotOnDeck:
    """The rig's own joints, for what they were taught."""
    body, names = source.skeleton, config.names
    JointRetargeter(body, names, np.zeros(len(names)))  # what does not fit is refused before anything is switched on
    limits = _limits_of(config)
    guard = opening.enter_context(guard_process())
    output = connect_rig(opening, guard, config, ports, names, limits)
    retarget = JointRetargeter(body, names, output.positions.copy())
    # A clip that limits have held back still comes to its last frame; a library ends where it stops.
    rest = np.clip(_targets(source, retarget)[-1], limits.lower, limits.upper) if isinstance(source, Clip) else None
    return RobotOnDeck("rig", names, limits, rest, retarget, Channel(output))


def recorded_deck(clip: Clip, retarget: Retargeter) -> RecordedDeck:
    """A deck that plays a taught clip once, as it is."""
    count = len(clip)
    fields = {
        "targets": _targets(clip, retarget),
        "playing": np.zeros((count, 1)),
        "root_position": clip.root_position,
        "heading": np.zeros((count, 1)),
        "root_rotation": clip.rotation[:, 0],
    }
    return RecordedDeck(RunRecording({"motions": [clip.name], "rate": clip.rate}, fields, complete=True))


def _targets(clip: Clip, retarget: Retargeter) -> Array:
    """The joint targets of a clip, shape (T, J), rad."""
    still = np.array(0.0)
    poses = zip(clip.root_position, clip.rotation, strict=True)
    return np.array([retarget(Pose(place, still, rotation)).copy() for place, rotation in poses])


def _limits_of(config: RigConfig) -> JointLimits:
    joints = config.joints
    lower, upper, velocity = np.array([(joint.lower, joint.upper, joint.velocity) for joint in joints]).T.copy()
    acceleration = np.array([joint.acceleration or _ACCELERATION for joint in joints])
    return JointLimits(lower, upper, velocity, acceleration, acceleration / _RISE)
