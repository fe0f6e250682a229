"""What is shown of clips and of recorded runs is where their joints are."""

import mujoco
import numpy as np
import pytest

from controller.motion.clip import Clip
from controller.wire.run_recording import RunRecording
from motiondeck.pictures.clip_scene import act_of, act_of_recording
from motiondeck_base.errors import MotiondeckError
from sim.models.scenery import FLOOR
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, human, smooth_poses


def moving(frames=12):
    poses = smooth_poses(human(), np.random.default_rng(0), frames, reach=0.6)
    rotation = np.array([pose.rotation for pose in poses])
    return Clip("moving", human(), 60.0, np.array([pose.root_position for pose in poses]), rotation)


def test_the_bones_shown_are_those_of_the_clip_and_of_the_mannequin():
    clip = moving()
    act = act_of(clip, None)
    np.testing.assert_allclose(act.bones[:, :, 1], clip.joints()[:, 1:], atol=1e-12)
    data = mujoco.MjData(act.model)
    for frame in range(len(clip)):
        data.qpos[:] = act.qpos[frame]
        mujoco.mj_kinematics(act.model, data)
        ends = [data.site(bone).xpos for bone in clip.skeleton.bones]
        np.testing.assert_allclose(ends, act.bones[frame, :, 1], atol=1e-9)
    assert act.stands.shape == (12, 2)


def test_a_robot_beside_the_human_is_opaque_and_has_its_own_feet():
    act = act_of(moving(), ROBOTS / "servo20.toml")
    names = [act.model.material(index).name for index in range(act.model.nmat)]
    opacity = dict(zip(names, act.model.mat_rgba[:, 3], strict=True))
    assert opacity["left"] < 1.0
    assert all(alpha == 1.0 for name, alpha in opacity.items() if "/" in name or name == FLOOR)
    assert act.stands.shape == (12, 4)


def recording(robot, ticks=24, joints=None):
    count = len(robot.joints) if joints is None else joints
    fields = {
        "targets": np.tile(np.linspace(0.0, 0.2, ticks)[:, None], (1, count)),
        "root_position": np.tile([0.5, 0.0, 0.9], (ticks, 1)),
        "root_rotation": np.tile([1.0, 0.0, 0.0, 0.0], (ticks, 1)),
        "heading": np.zeros((ticks, 1)),
    }
    return RunRecording(description={"robot": robot.name, "rate": 120.0, "motions": []}, fields=fields, complete=True)


def test_a_recorded_run_is_shown_where_it_was_told_to_be():
    robot = load_robot(ROBOTS / "servo20.toml", human())
    act = act_of_recording(recording(robot), robot)
    assert (len(act.qpos), act.rate) == (12, 60.0)
    measured = np.empty(20)
    robot.layout.read(act.qpos[-1], near=np.zeros(20), out=measured)
    np.testing.assert_allclose(measured, np.linspace(0.0, 0.2, 24)[22], atol=1e-9)
    # Of the pose its root alone is recorded, so that nobody knows where its feet stood.
    assert act.stands.size == len(act.prints) == 0


def test_a_run_of_another_robot_is_refused():
    robot = load_robot(ROBOTS / "servo20.toml", human())
    with pytest.raises(MotiondeckError, match="no targets for the 20 joints"):
        act_of_recording(recording(robot, joints=3), robot)
