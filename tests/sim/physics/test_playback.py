import numpy as np
import pytest

from controller.motion.skeleton import Pose
from sim.physics.kinematic_playback import KinematicPlayback
from sim.physics.playback import PhysicsPlayback
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, bent_pose, human, smooth_poses

NAMES = ["mannequin", "servo20"]


def load(name):
    return load_robot(ROBOTS / f"{name}.toml", human())


def walk_on(pose, x):
    return Pose(pose.root_position + np.array([x, 0.0, 0.0]), pose.heading, pose.rotation)


@pytest.mark.parametrize("name", NAMES)
def test_kinematic_playback_is_where_it_is_told_to_be(name):
    robot = load(name)
    output = KinematicPlayback(robot)
    pose = walk_on(bent_pose(human(), lelb=(0.3, 0.2, -0.4)), 0.5)
    targets = np.clip(robot.retarget(pose), robot.limits.lower, robot.limits.upper)
    output.write(targets, pose)
    assert np.allclose(output.measured(), targets)
    if name == "mannequin":
        assert np.allclose(output.qpos[:3], pose.root_position)
    read = np.empty_like(targets)
    robot.layout.read(output.qpos, near=targets, out=read)
    assert np.allclose(read, targets)
    assert output.report()["writes"] == 1
    output.close()
    output.close()


@pytest.mark.parametrize("name", NAMES)
def test_before_the_first_write_the_robot_rests(name):
    robot = load(name)
    for output in (KinematicPlayback(robot), PhysicsPlayback(robot, 0.005)):
        read = np.empty_like(robot.rest)
        robot.layout.read(output.qpos, near=robot.rest, out=read)
        assert np.allclose(read, robot.rest)
        assert np.allclose(output.measured(), robot.rest)


@pytest.mark.parametrize("name", NAMES)
def test_servos_track_a_moving_body_that_a_gantry_carries_along(name):
    robot = load(name)
    output = PhysicsPlayback(robot, 0.005)
    # step 0.01 at 200 Hz: the slowest wave turns at 2 rad/s, the fastest at 6 rad/s; servos get what they can do.
    step = 0.01 if robot.servo is None else 0.004
    poses = smooth_poses(human(), np.random.default_rng(3), 300, reach=0.6, step=step)
    behind = []
    for frame, pose in enumerate(poses):
        pose = walk_on(pose, 0.005 * frame)
        output.write(robot.retarget(pose), pose)
        behind.append(np.abs(output.qpos[:3] - output.data.mocap_pos[0]).max())
    report = output.report()
    assert report["faults"] == 0
    assert report["tracking_rmse_rad"] < 0.05
    assert max(behind) < 0.03
    assert np.isfinite(output.qpos).all()


@pytest.mark.parametrize("name", NAMES)
def test_a_posture_is_held_against_gravity(name):
    robot = load(name)
    output = PhysicsPlayback(robot, 0.005)
    pose = bent_pose(human(), relb=(0.3, 0, 0.2), lkne=(0, -0.7, 0))
    targets = robot.retarget(pose).copy()
    for _ in range(300):
        output.write(targets, pose)
    assert np.abs(output.measured() - targets).max() < 0.05


def test_physics_really_passes_in_whole_steps():
    robot = load("servo20")
    output = PhysicsPlayback(robot, 0.0099)
    pose = bent_pose(human())
    output.write(robot.retarget(pose), pose)
    assert output.data.time == pytest.approx(0.01)


@pytest.mark.parametrize("name", NAMES)
def test_a_broken_state_is_put_right_and_counted(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    robot = load(name)
    output = PhysicsPlayback(robot, 0.005)
    pose = bent_pose(human())
    targets = robot.retarget(pose).copy()
    output.write(targets, pose)
    output.data.qvel[8] = np.nan
    output.write(targets, pose)
    assert output.report()["faults"] == 1
    output.data.qpos[:] = np.nan
    output.write(targets, pose)
    assert output.report()["faults"] == 2
    for _ in range(50):
        output.write(targets, pose)
    assert output.report()["faults"] == 2
    assert np.abs(output.measured() - targets).max() < 0.1
    assert np.isfinite(output.report()["tracking_rmse_rad"])
    # MuJoCo would leave a log of its warnings where one happens to stand.
    assert list(tmp_path.iterdir()) == []
