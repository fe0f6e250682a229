from dataclasses import replace

import mujoco
import numpy as np
import pytest

from controller.motion.rotations import from_matrix
from sim.physics.physics_model import feet_of, physics_model
from sim.physics.walking.whole_body import SHIFTED, WholeBody, widest_stance
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, human


@pytest.fixture(scope="module")
def robot():
    return load_robot(ROBOTS / "servo20.toml", human())


def how_wide(robot, most=0.9):
    """In heights of the root, bent as it walks, beginning at 0.36."""
    model, feet = physics_model(robot, "free"), feet_of(robot)
    data = mujoco.MjData(model)
    robot.layout.place(robot.rest, data.qpos)
    mujoco.mj_kinematics(model, data)
    soles = [data.xpos[model.body(f.body).id] + data.xmat[model.body(f.body).id].reshape(3, 3) @ f.sole for f in feet]
    data.qpos[2] -= np.mean(soles, axis=0)[2]
    height = float(data.qpos[2])
    sides = np.sign([sole[1] for sole in soles])
    body = WholeBody(robot, model, feet, 0.005, 15.0)
    goal = data.qpos.copy()
    goal[2] -= robot.walk.bend * height
    flat = [from_matrix(foot.axes.T) for foot in feet]
    return widest_stance(body, goal, flat, sides, 0.36 * height, most * height) / height


def with_ankles(robot, degrees):
    """The robot whose ankles turn sideways so far, to either side."""
    lower, upper = robot.limits.lower.copy(), robot.limits.upper.copy()
    for side in "rl":
        ankle = robot.joints.index(f"{side}_ankle_roll")
        lower[ankle], upper[ankle] = -np.radians(degrees), np.radians(degrees)
    return replace(robot, limits=replace(robot.limits, lower=lower, upper=upper))


def test_ankles_that_turn_far_spread_as_far_as_is_asked(robot):
    assert how_wide(robot, 0.7) == pytest.approx(0.7)


@pytest.mark.parametrize("degrees", [12.0, 18.0])
def test_stiff_ankles_spread_as_far_as_a_leg_that_leans_by_their_range_reaches(robot, degrees):
    model = robot.model
    data = mujoco.MjData(model)
    robot.layout.place(robot.rest, data.qpos)
    mujoco.mj_kinematics(model, data)
    hip, ankle = (data.xanchor[model.joint(f"l_{name}_roll").id] for name in ("hip", "ankle"))
    leg = (hip - ankle)[2] - robot.walk.bend * data.qpos[2]
    # From the centre of mass sideways to the hip, and on by the leg that leans.
    reaches = hip[1] + leg * np.tan(np.radians(degrees))
    height = float(data.qpos[2] - (data.xpos[model.body(feet_of(robot)[0].body).id])[2])
    assert how_wide(with_ankles(robot, degrees)) == pytest.approx(reaches / (1.0 - SHIFTED) / height, rel=0.15)


def test_ankles_that_do_not_turn_sideways_leave_the_least_width(robot):
    assert how_wide(with_ankles(robot, 2.0)) == pytest.approx(0.36, abs=0.02)
