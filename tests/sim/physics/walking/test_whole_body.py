import mujoco
import numpy as np
import pytest

from controller.rotations import from_matrix
from sim.physics.physics_model import feet_of, physics_model
from sim.physics.walking.whole_body import WholeBody
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, human

LOW, RISE = 0.03, 0.0005
BENT = {"hip_pitch": -0.5, "knee": 1.0, "ankle_pitch": -0.5}


@pytest.fixture(scope="module")
def robot():
    return load_robot(ROBOTS / "servo20.toml", human())


def heights_from_a_squat(robot, rise):
    """Tick by tick, how high the root is of who squats and is to stand up; and how far soles leave their places."""
    model, feet = physics_model(robot, "free"), feet_of(robot)
    body, data = WholeBody(robot, model, feet, 0.005, 15.0), mujoco.MjData(model)
    robot.layout.place(robot.rest, data.qpos)
    mujoco.mj_kinematics(model, data)

    def soles(at):
        frames = [(at.xpos[k], at.xmat[k].reshape(3, 3)) for k in body.bodies]
        return [place + frame @ foot.sole for (place, frame), foot in zip(frames, feet, strict=True)]

    places, turns = soles(data), [from_matrix(foot.axes.T) for foot in feet]
    middle, low = np.mean(places, axis=0)[:2], data.qpos.copy()
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
        slid = max(slid, *(np.linalg.norm(a - b) for a, b in zip(soles(body.plan), places, strict=True)))
    return np.array(heights), slid


def test_the_root_rises_no_faster_than_it_may_and_the_soles_stay_where_they_are(robot):
    free, slid = heights_from_a_squat(robot, np.inf)
    assert np.diff(free).max() > 3.0 * RISE
    held, slid_held = heights_from_a_squat(robot, RISE)
    assert np.allclose(np.diff(held), RISE, atol=0.02 * RISE)
    assert slid_held <= slid
