"""Tests of limbs that small steps do not bring to their goals."""

import numpy as np
import pytest

from sim.retargeting import inverse_kinematics
from sim.retargeting.human_limbs import LIMBS, LimbView
from sim.retargeting.limb_finder import FEET
from sim.retargeting.robot_limbs import limb_directions
from sim.retargeting.stuck_limbs import FAR, StuckLimbs
from sim.robots.robot import load_robot
from simulated_bodies import bent_pose, human
from small_robots import calibrated, humanoid

DT = 0.01


@pytest.fixture
def robot(tmp_path):
    (tmp_path / "small.xml").write_text(humanoid())
    file = tmp_path / "small.toml"
    file.write_text(calibrated(tmp_path / "small.xml").to_toml(tmp_path))
    return load_robot(file, human(), "ik", DT)


def miss(robot, pose, limb):
    there = limb_directions(robot.retarget.solver.limbs)[LIMBS.index(limb)]
    return np.degrees(np.arccos(np.clip(there @ LimbView(human())(pose)[LIMBS.index(limb)], -1.0, 1.0)))


def stuck(robot, pose):
    """Starts the robot with its left arm wound to the wrong side, up against the end of a joint's range."""
    solver = robot.retarget.solver
    robot.retarget(pose)
    q = solver.q.copy()
    q[robot.joints.index("left_arm_pitch")] = robot.limits.lower[robot.joints.index("left_arm_pitch")]
    q[robot.joints.index("left_arm_roll")] = 2.0
    solver.q = q
    return q


def test_a_limb_that_is_stuck_finds_its_way_no_faster_than_it_may(robot):
    pose = bent_pose(human(), lelb=(-0.9, 0, 0), relb=(0.9, 0, 0))
    before = stuck(robot, pose)
    for _ in range(100):
        q = robot.retarget(pose)
        assert np.abs(q - before).max() <= robot.limits.velocity.max() * DT + 1e-9
        before = q.copy()
    assert miss(robot, pose, "l_upper_arm") < 5.0


def test_without_a_second_look_it_stays_there(robot, monkeypatch):
    pose = bent_pose(human(), lelb=(-0.9, 0, 0), relb=(0.9, 0, 0))
    monkeypatch.setattr(type(robot.retarget.solver.stuck), "__call__", lambda self, q, *rest: q)
    stuck(robot, pose)
    for _ in range(100):
        robot.retarget(pose)
    assert miss(robot, pose, "l_upper_arm") > np.degrees(FAR)


def test_a_goal_out_of_reach_keeps_the_limb_where_it_is(robot):
    pose = bent_pose(human(), rank=(0, -1.5, 0))  # a knee cannot bend forward
    robot.retarget(pose)
    # With a pelvis that gives way the leg rolls off the middle of its ranges before it settles.
    path = np.array([robot.retarget(pose).copy() for _ in range(200)])
    assert not robot.retarget.solver.stuck.crossing.any()
    assert np.abs(np.diff(path[150:], axis=0)).max() < 1e-3


@pytest.mark.parametrize("tries", [0, 16])
def test_a_limb_that_is_off_in_the_first_pose_is_tried_from_other_angles(robot, monkeypatch, tries):
    monkeypatch.setattr(inverse_kinematics, "TRIES", tries)
    pose = bent_pose(human(), lelb=(-0.9, 0, 0), relb=(0.9, 0, 0))
    robot.retarget.solver._rest = stuck(robot, pose)
    robot.retarget.reset()
    robot.retarget(pose)
    assert (miss(robot, pose, "l_upper_arm") < 5.0) == bool(tries)


def arms_with_a_waist(scout, scout_misses):
    """Two arms of one joint each on a waist; the scout reaches its goal at once."""
    moved = np.array([[True, True, False], [True, False, True], [True, True, True]])
    names = ["r_upper_arm", "l_upper_arm", FEET]
    found = np.array(scout), np.array(scout_misses)
    return StuckLimbs(names, moved, np.ones(3), np.zeros(3), lambda *_: found, DT)


def go(limbs, q, missed):
    q, far = np.array(q), np.full(3, 3.0)
    return limbs(q, np.array(missed), np.zeros((3, 3)), -far, far, q - 0.1, q + 0.1)


def test_the_joints_of_the_stuck_limb_alone_go_over_as_fast_as_they_may():
    limbs = arms_with_a_waist([1.0, 1.0, 1.0], [0.0, 0.0, 0.0])
    np.testing.assert_allclose(go(limbs, [0.0, 0.0, 2.0], [0.0, 1.0, 0.0]), [0.0, 0.0, 1.9])
    np.testing.assert_array_equal(limbs.crossing, [False, False, True])
    # Its way is followed to the end, though the goal is no longer far; then it is left to small steps again.
    np.testing.assert_allclose(go(limbs, [0.0, 0.0, 1.3], [0.0, 0.1, 0.0]), [0.0, 0.0, 1.2])
    np.testing.assert_allclose(go(limbs, [0.0, 0.0, 1.05], [0.0, 0.1, 0.0]), [0.0, 0.0, 1.0])
    assert not limbs.crossing.any()


def test_a_scout_that_misses_by_more_than_half_is_not_followed_and_the_next_looks_after_a_pause():
    limbs = arms_with_a_waist([1.0, 1.0, 1.0], [0.0, 0.3, 0.0])
    stays = [0.0, 0.0, 2.0]
    np.testing.assert_array_equal(go(limbs, stays, [0.0, 1.0, 0.0]), stays)
    limbs._advance = lambda *_: (np.ones(3), np.zeros(3))
    calls = 0
    while not limbs.crossing.any():
        calls += 1
        go(limbs, stays, [0.0, 1.0, 0.0])
    assert calls == round(0.25 / DT)
