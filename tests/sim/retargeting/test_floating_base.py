"""The pelvis as a part of inverse kinematics: what it takes over from hips, and what it leaves to them."""

import numpy as np
import pytest

from benchmarks.robots.world_robots import written_robot
from sim.retargeting import inverse_kinematics
from sim.retargeting.human_limbs import LIMBS, LimbView
from sim.robots.limb_directions import LimbDirections
from sim.robots.robot import RobotLoader
from simulated_bodies import bent_pose, human
from small_robots import calibrated

SEATED = bent_pose(human(), rkne=(0, -1.6, 0), lkne=(0, -1.6, 0))


@pytest.fixture(scope="module", params=["ball_forearm", "no_waist"])
def files(request, tmp_path_factory):
    """A robot with a waist of three hinges and one without, whose hips raise a thigh by 1.1 rad only."""
    folder = tmp_path_factory.mktemp("floating")
    (folder / "robot.xml").write_text(written_robot(request.param).replace("-2.2 1", "-1.1 1"))
    (folder / "robot.toml").write_text(calibrated(folder / "robot.xml").to_toml(folder))
    return request.param, RobotLoader(folder / "robot.toml")


def off(load):
    """Degrees of the right thigh and the trunk from a seated human's, when the robot has settled."""
    robot, qpos = load(human(), None, 0.01), None
    qpos = robot.model.qpos0.copy()
    for _ in range(30):
        robot.place(robot.retarget(SEATED), SEATED, qpos)
    directions = LimbDirections(robot.model, load.file.parts, np.array(load.file.root_rotation))
    world = LimbView(human())(SEATED)[None]
    thigh = [segment.name for segment in directions.segments].index("r_thigh")
    return directions.degrees(qpos[None], world)[0, thigh], directions.trunk_errors(qpos[None], world)[0]


def test_a_waist_lets_the_pelvis_tilt_for_hips_that_end_and_a_rigid_trunk_shares(files, monkeypatch):
    name, load = files
    thigh, trunk = off(load)
    monkeypatch.setattr(inverse_kinematics, "FARTHEST", 0.0)
    alone, _ = off(load)
    assert thigh < 0.75 * alone
    assert trunk < (3.0 if name == "ball_forearm" else 20.0)


def test_standing_the_pelvis_is_where_joint_points_say(files):
    robot = files[1](human(), None, 0.01)
    for _ in range(30):
        robot.retarget(bent_pose(human()))
    assert robot.retarget.solver.tilt == pytest.approx(np.eye(3), abs=0.02)


def test_an_arm_out_of_reach_does_not_tilt_the_pelvis(files):
    robot = files[1](human(), None, 0.01)
    pose = bent_pose(human(), relb=(0, 0, -2.5), lelb=(0, 0, 2.5))
    for _ in range(30):
        robot.retarget(pose)
    assert robot.retarget.solver.tilt == pytest.approx(np.eye(3), abs=0.02)
    assert LIMBS[0] == "r_upper_arm"
