"""Scenes of recordings for the page: body, bones, footprints, and a robot beside the human."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from controller.motion.clip import Clip, poses_of
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from controller.wire.run_recording import RunRecording
from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    import mujoco

    from motiondeck.page.clip_page import Act
    from sim.models.feet import Foot
    from sim.robots.robot import Robot

PICTURES = 60.0  # frames a second that are kept of a recorded run
GHOST = 0.45  # opacity of the human where a robot or its bones are to be seen


def act_of(clip: Clip, robot: Path | None, ghost: bool = True) -> Act:
    """The scene of a clip, of the human alone or beside a robot of a file; `ghost` makes the human translucent.

    MotiondeckError if the robot cannot be loaded, or cannot be fitted to this body.
    """
    from sim.models.scenery import FLOOR

    model, qpos, joints, feet = _alone(clip) if robot is None else _beside(clip, robot)
    # The materials of a robot beside the human have a name of two parts.
    for material in map(model.material, range(model.nmat if ghost else 0)):
        if material.name != FLOOR and "/" not in material.name:
            material.rgba[3] = GHOST
    for light in range(model.nlight):
        # One lamp is enough for two bodies.
        model.light_active[light] = "/" not in model.light(light).name
    parent = clip.skeleton.parent + 1
    bones = np.stack([joints[:, parent], joints[:, 1:]], axis=2)
    title = f"Motiondeck · {clip.name}" + ("" if robot is None else f" · {robot.stem}")
    return _stepping(title, model, qpos, clip.rate, bones, feet)


def act_of_recording(recording: RunRecording, robot: Robot) -> Act:
    """The scene of a recorded run: the robot at its targets, with footprints if they are known.

    MotiondeckError if nothing was recorded, or it was another robot's.
    """
    from sim.physics.physics_model import feet_of

    fields = recording.fields
    if recording.ticks == 0 or fields["targets"].shape[1] < len(robot.joints):
        raise MotiondeckError(f"the recording holds no targets for the {len(robot.joints)} joints of {robot.name}")
    rate = float(recording.description["rate"])
    thin = max(1, round(rate / PICTURES))
    model = robot.model
    placed = fields.get("robot_root") if robot.name == recording.description["robot"] else None
    qpos = np.tile(model.qpos0, (len(range(0, recording.ticks, thin)), 1))
    for row, tick in enumerate(range(0, recording.ticks, thin)):
        pose = Pose(fields["root_position"][tick], fields["heading"][tick, 0], fields["root_rotation"][tick][None])
        robot.place(fields["targets"][tick, : len(robot.joints)], pose, qpos[row])
        if placed is not None:
            qpos[row, :7] = placed[tick]
    title = f"Motiondeck · {robot.name} · replay"
    no_bones = np.zeros((len(qpos), 0, 2, 3))
    # Where its feet stood tells the whole pose, of which version 1 recorded the human's root alone.
    feet = [] if placed is None and robot.footing is not None else feet_of(robot)
    return _stepping(title, model, qpos, rate / thin, no_bones, feet)


def _stepping(title: str, model: mujoco.MjModel, qpos: Array, rate: float, bones: Array, feet: Sequence[Foot]) -> Act:
    """A scene with what the feet do and leave on the floor."""
    from motiondeck.page.body.footprints import followed
    from motiondeck.page.clip_page import Act

    soles, stands, prints = followed(model, qpos, feet, rate)
    return Act(title, model, qpos, rate, bones, prints, stands, soles)


def _alone(clip: Clip) -> tuple[mujoco.MjModel, Array, Array, list[Foot]]:
    """The mannequin of a clip, its qpos (T, nq), the human's joints and the feet."""
    from sim.models.feet import find_feet
    from sim.models.joint_layout import JointLayout
    from sim.models.mannequin.mannequin import build_mannequin
    from sim.retargeting.retarget import MannequinRetargeter

    model = build_mannequin(clip.skeleton).compile()
    layout, retarget = JointLayout.of(model), MannequinRetargeter(clip.skeleton)
    qpos = np.empty((len(clip), model.nq))
    for frame, pose in enumerate(poses_of(clip)):
        qpos[frame, :3], qpos[frame, 3:7] = pose.root_position, pose.rotation[0]
        layout.place(retarget(pose), qpos[frame])
    return model, qpos, clip.joints(), list(find_feet(model, model.qpos0))


def _beside(clip: Clip, robot: Path) -> tuple[mujoco.MjModel, Array, Array, list[Foot]]:
    """A human of the robot's size and the robot, their qpos (T, nq), the human's joints and the feet of both."""
    from motiondeck.pictures.side_by_side import PREFIX, SideBySide
    from sim.models.feet import find_feet
    from sim.physics.physics_model import feet_of

    both = SideBySide(clip.skeleton, robot, 1.0 / clip.rate)
    qpos = np.array([both.qpos(pose, own_path=True).copy() for pose in poses_of(clip)])
    feet = list(find_feet(both.human.model, both.human.model.qpos0))
    feet += [replace(foot, body=PREFIX + foot.body) for foot in feet_of(both.robot)]
    return both.model, qpos, clip.joints() * both.scale, feet
