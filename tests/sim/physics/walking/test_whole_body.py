import mujoco
import numpy as np
import pytest

from controller.motion.rotations import from_matrix
from sim.physics.physics_model import feet_of, physics_model
from sim.physics.walking.whole_body import BENT as BENT_KNEE
from sim.physics.walking.whole_body import WholeBody
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, human

LOW, RISE = 0.03, 0.0005
BENT = {"hip_pitch": -0.5, "knee": 1.0, "ankle_pitch": -0.5}


@pytest.fixture(scope="module")
def robot():
    return load_robot(ROBOTS / "servo20.toml", human())


def standing(robot):
    """The solver, a state at rest, places of its soles, rotations of its feet, and the soles' middle."""
    model, feet = physics_model(robot, "free"), feet_of(robot)
    body, data = WholeBody(robot, model, feet, 0.005, 15.0), mujoco.MjData(model)
    robot.layout.place(robot.rest, data.qpos)
    mujoco.mj_kinematics(model, data)
    places = [body.sole(data, foot) for foot in range(2)]
    return body, data, places, [from_matrix(foot.axes.T) for foot in feet], np.mean(places, axis=0)[:2]


def heights_from_a_squat(robot, rise):
    """Height of a root that rises from a squat, and displacement of the soles, by tick."""
    model, (body, data, places, turns, middle) = physics_model(robot, "free"), standing(robot)
    low = data.qpos.copy()
    for joint, angle in BENT.items():
        for side in "rl":
            low[model.joint(f"{side}_{joint}").qposadr] = angle
    low[2] -= LOW
    body.plan.qpos[:] = low
    body.settle(low, places, turns, middle)
    heights, slid = [float(body.plan.qpos[2])], 0.0
    for _ in range(12):
        body.step(data.qpos.copy(), places, turns, middle, rise)
        mujoco.mj_kinematics(model, body.plan)
        heights.append(float(body.plan.qpos[2]))
        slid = max(slid, *(np.linalg.norm(body.sole(body.plan, foot) - places[foot]) for foot in range(2)))
    return np.array(heights), slid


def test_the_root_rises_no_faster_than_it_may_and_the_soles_stay_where_they_are(robot):
    free, slid = heights_from_a_squat(robot, np.inf)
    assert np.diff(free).max() > 3.0 * RISE
    held, slid_held = heights_from_a_squat(robot, RISE)
    assert np.allclose(np.diff(held), RISE, atol=0.02 * RISE)
    assert slid_held <= slid


@pytest.mark.parametrize("heights", [0.3, 0.6])
def test_a_leg_that_reaches_far_keeps_its_knee_bent_and_the_root_sinks_no_faster_for_it(robot, heights):
    model, (body, data, places, turns, middle) = physics_model(robot, "free"), standing(robot)
    knees = model.jnt_qposadr[[model.joint(f"{side}_knee").id for side in "rl"]]
    body.plan.qpos[:] = data.qpos
    body.settle(data.qpos, places, turns, middle)
    moves = []
    for far in [*np.linspace(0.0, heights * data.qpos[2], 60), *[heights * data.qpos[2]] * 100]:
        there, before = places[0] + (far, 0.0, 0.0), body.plan.qpos.copy()
        body.step(data.qpos, (there, places[1]), turns, middle + np.array([0.5 * far, 0.0]), RISE)
        mujoco.mj_kinematics(model, body.plan)
        moves.append(body.plan.qpos - before)
        assert (body.plan.qpos[knees] > BENT_KNEE - 0.001).all()
        assert -1.02 * RISE < moves[-1][2] < 1.02 * RISE
    # In the end it stands there, and nothing turns to and fro.
    assert np.linalg.norm(body.sole(body.plan, 0) - there) < 0.001
    assert np.abs(moves[-20:]).max() < 1e-4
