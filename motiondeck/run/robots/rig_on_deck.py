"""A rig alone on the deck: its joints play what they were taught, and its figure shows where they are."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from controller.deck.interfaces import JointLimits, Retargeter
from controller.deck.live_values import Gains
from controller.deck.recorded_deck import RecordedDeck
from controller.library.motion_library import MotionLibrary
from controller.loop.output_channel import Channel
from controller.motion.clip import Clip
from controller.motion.encodings.joint_angles import JointRetargeter
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose, Skeleton
from controller.wire.run_recording import RunRecording
from hardware.rig.rig_file import load_rig
from motiondeck.run.guard.guarded_rig import GuardedRig, guard_process
from motiondeck.run.robots.rig_output import RigOutput, open_rig
from motiondeck.run.spec.run_spec import RunSpec, is_emulated, options
from motiondeck_base.errors import MotiondeckError
from sim.physics.kinematic_playback import KinematicPlayback
from sim.robots.joint_groups import Groups, named_groups
from sim.robots.rig_robot import groups_of, rig_robot
from sim.robots.robot import Robot

if TYPE_CHECKING:
    from hardware.rig.supervision.rig import Rig

# What a joint may do whose acceleration the rig file leaves open, rad/s^2; the jerk brings it there in 20 ms.
_ACCELERATION = 80.0
_RISE = 0.02  # s
_SIMULATED = ("solver", "physics", "root", "balance", "walk", "check_collisions")  # options of simulated robots


class RigFigure(KinematicPlayback):
    """The figure of a rig alone where its servos measure it, with their targets in `wanted`."""

    def __init__(self, robot: Robot, rig: Rig | GuardedRig) -> None:
        super().__init__(robot)
        self._rig, self.wanted = rig, self.qpos.copy()

    def write(self, targets: Array, pose: Pose) -> None:
        """Places the targets (J,), rad, and the measured joints."""
        self._robot.layout.place(targets, self.wanted)
        self._robot.layout.place(self._rig.positions, self.qpos)
        self._measured, self._writes = self._rig.positions, self._writes + 1


def open_rig_alone(
    opening: ExitStack, spec: RunSpec, file: Path, source: Clip | MotionLibrary
) -> tuple[Robot, Array | None, Channel, RigFigure, Groups, Gains]:
    """Connects the rig of a file, whose joints follow what they were taught; `opening` closes it.

    Its robot, where the joints end, shape (J,), rad, or None for where they stop, its servos, its figure, the groups
    of its joints, and how they look somewhere. Those that were not taught stay where they are. MotiondeckError if an
    option or the source does not fit a rig (before anything is switched on), or it cannot be connected.
    """
    for name in _SIMULATED:
        if getattr(spec, name) != getattr(RunSpec(), name):
            flag = options()[name].flag or f"--{name.replace('_', '-')}"
            raise MotiondeckError(f"{flag} is for a simulated robot, and a rig alone has none: name one with --robot")
    guard = opening.enter_context(guard_process())  # it gets ready while the figure is made
    robot = robot_of(file, source.skeleton)
    channel, _ = open_rig(opening, guard, file, robot, spec.rate, emulated=is_emulated(spec.rig))
    output = channel.output
    assert isinstance(output, RigOutput)
    retarget = JointRetargeter(source.skeleton, robot.joints, output.rig.positions.copy())
    # A clip that limits have held back still comes to its last frame; a library ends where it stops.
    limits, rest = robot.limits, None
    if isinstance(source, Clip) and not _closes(source):
        rest = np.clip(_target(source, -1, retarget), limits.lower, limits.upper)
    config = output.rig.config
    groups = groups_of(robot.joints) | named_groups(str(file), robot.joints, config.groups)
    looking = named_groups(str(file), robot.joints, {"gaze": (*config.gaze.pan, *config.gaze.tilt)}, "")
    gaze = {joint: (config.gaze.pan.get(joint, 0.0), config.gaze.tilt.get(joint, 0.0)) for joint in looking["gaze"]}
    return replace(robot, retarget=retarget), rest, channel, RigFigure(robot, output.rig), groups, gaze


def robot_of(file: Path, skeleton: Skeleton) -> Robot:
    """The robot of a rig file for motions of a skeleton; MotiondeckError if these or its model do not fit."""
    config = load_rig(file)
    lower, upper, velocity = np.array([(one.lower, one.upper, one.velocity) for one in config.joints]).T.copy()
    acceleration = np.array([joint.acceleration or _ACCELERATION for joint in config.joints])
    limits = JointLimits(lower, upper, velocity, acceleration, acceleration / _RISE)
    return rig_robot(file, config.names, limits, Path(config.model) if config.model else None, skeleton)


def recorded_deck(clip: Clip, retarget: Retargeter) -> RecordedDeck:
    """A deck that plays a clip of joints as it is: again and again if it loops and ends as it begins, else once."""
    count = len(clip)
    fields = {
        "targets": np.array([_target(clip, frame, retarget).copy() for frame in range(count)]),
        "playing": np.zeros((count, 1)),
        "root_position": clip.root_position,
        "heading": np.zeros((count, 1)),
        "root_rotation": clip.rotation[:, 0],
    }
    return RecordedDeck(
        RunRecording({"motions": [clip.name], "rate": clip.rate}, fields, complete=True), loops=_closes(clip)
    )


def _closes(clip: Clip) -> bool:
    """Whether a clip is a loop whose last frame is its first, as keyframes are; a taught one is closed by learning."""
    return clip.plays == "loop" and len(clip) > 1 and bool(np.allclose(clip.rotation[0], clip.rotation[-1], atol=1e-4))


def _target(clip: Clip, frame: int, retarget: Retargeter) -> Array:
    """The joint targets of a frame, shape (J,), rad."""
    return retarget(Pose(clip.root_position[frame], np.array(0.0), clip.rotation[frame]))
