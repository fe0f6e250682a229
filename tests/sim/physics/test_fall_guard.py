import mujoco
import numpy as np
import pytest

from sim.physics.physics_model import physics_model
from sim.physics.playback import PhysicsPlayback
from sim.physics.recovery import SOFT, Recovery
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, bent_pose, human

DT = 0.005


def load(name="servo20"):
    return load_robot(ROBOTS / f"{name}.toml", human())


@pytest.mark.parametrize("name", ["mannequin", "servo20"])
def test_it_goes_to_the_tucked_pose_no_faster_than_the_joints_can(name):
    robot = load(name)
    model = physics_model(robot, "free")
    guard, data = Recovery(robot, model, DT), mujoco.MjData(model)
    goal, joints = robot.model.qpos0.copy(), robot.rest.copy()
    robot.layout.place(robot.rest, goal)
    for _ in range(400):
        before = joints.copy()
        guard.adjust(data, goal.copy(), goal, falling=True, held=True)
        robot.layout.read(goal, near=robot.tucked, out=joints)
        assert (np.abs(joints - before) <= robot.limits.velocity * DT + 1e-9).all()
    assert np.allclose(joints, robot.tucked, atol=1e-6)


def test_servos_are_soft_until_it_lets_go():
    robot = load()
    model = physics_model(robot, "free")
    gain, damping = model.actuator_gainprm[:, 0].copy(), model.actuator_biasprm[:, 2].copy()
    guard, goal = Recovery(robot, model, DT), robot.model.qpos0.copy()
    guard.adjust(mujoco.MjData(model), goal.copy(), goal, falling=True)
    assert np.allclose(model.actuator_gainprm[:, 0], SOFT * gain)
    assert np.allclose(model.actuator_biasprm[:, 1], -SOFT * gain)
    assert np.allclose(model.actuator_biasprm[:, 2], damping)
    guard.start()
    assert np.allclose(model.actuator_gainprm[:, 0], gain)
    assert np.allclose(model.actuator_biasprm[:, 1], -gain)


def pushed(seconds, force, *, walk=True, guard=True):
    """Stands and is pushed for 0.1 s after 0.2 s; the stage at the end."""
    robot = load()
    stage = PhysicsPlayback(robot, DT, "free", balance=not walk, walk=walk, guard=guard)
    pose = bent_pose(human())
    for tick in range(round(seconds / DT)):
        stage.push(np.array([force, 0.0, 0.0]) * (40 <= tick < 60))
        stage.write(robot.rest, pose)
    return stage


@pytest.mark.parametrize("walk", [True, False])
def test_a_robot_that_falls_ends_tucked_and_one_that_stands_does_not(walk):
    tucked = load().tucked
    knees = [joint for joint, name in enumerate(load().joints) if name.endswith("knee")]
    fallen = pushed(1.5, 40.0, walk=walk)
    assert fallen.fell_s is not None
    assert np.abs(fallen.measured() - tucked)[knees].max() < 0.25
    standing = pushed(0.6, 2.0, walk=walk)
    assert standing.fell_s is None
    assert np.abs(standing.measured() - tucked)[knees].min() > 0.5


def test_without_the_guard_it_keeps_its_strength():
    stage = pushed(1.0, 40.0, guard=False)
    assert stage.fell_s is not None
    assert np.allclose(stage.model.actuator_gainprm[:, 0], load().model.actuator_gainprm[:, 0])


def test_what_is_put_in_place_anew_is_strong_again():
    stage = pushed(1.0, 40.0)
    stage.data.qpos[:] = np.nan
    stage.write(load().rest, bent_pose(human()))
    assert np.allclose(stage.model.actuator_gainprm[:, 0], load().model.actuator_gainprm[:, 0])
