import mujoco
import numpy as np
import pytest

from sim.physics.physics_model import feet_of, physics_model
from sim.physics.walking.whole_body import BENT, bent_knees, knee_of
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, human

# A leg of a hip that rolls and bends, a knee and an ankle; the knee is before or behind the line from hip to ankle.
LEG = """<mujoco><worldbody><body name="trunk" pos="0 0 1"><freejoint/><geom size=".1"/>
<body name="thigh"><joint name="roll" axis="1 0 0"/><joint name="hip" axis="0 1 0"/>
<geom type="capsule" size=".03" fromto="0 0 0 {x} 0 -.4"/>
<body name="shank" pos="{x} 0 -.4"><joint name="knee" axis="0 {axis} 0" {range}/>
<geom type="capsule" size=".03" fromto="0 0 0 -{x} 0 -.4"/>
<body name="foot" pos="-{x} 0 -.4"><joint name="ankle" axis="0 1 0"/><geom type="box" size=".1 .04 .02"/>
</body></body></body></body></worldbody></mujoco>"""


def leg(x=0.05, axis=1, ends="range='-10 150' limited='true'"):
    model = mujoco.MjModel.from_xml_string(LEG.format(x=x, axis=axis, range=ends))
    return model, int(model.body("foot").id)


def reach(model, foot, angles):
    """How far the ankle is from the hip with a knee turned by each of these angles."""
    data, distances = mujoco.MjData(model), []
    for angle in angles:
        data.joint("knee").qpos = angle
        mujoco.mj_kinematics(model, data)
        distances.append(np.linalg.norm(data.xpos[foot] - data.xanchor[model.joint("hip").id]))
    return np.array(distances)


@pytest.mark.parametrize("x", [0.0, 0.02, 0.08])
@pytest.mark.parametrize("axis", [1, -1])
def test_a_knee_is_straight_where_the_leg_is_longest(x, axis):
    model, foot = leg(x, axis)
    knee = knee_of(model, foot)
    assert knee is not None
    joint, straight = knee
    assert model.joint(joint).name == "knee"
    angles = np.linspace(-1.0, 1.0, 2001)
    longest = angles[np.argmax(reach(model, foot, angles))]
    assert straight == pytest.approx(longest, abs=0.002)


@pytest.mark.parametrize(("ends", "folds"), [("-10 150", 1), ("-150 10", -1)])
def test_knees_stay_bent_the_way_they_fold(ends, folds):
    model, foot = leg(0.05, ends=f"range='{ends}' limited='true'")
    joints, lower, upper = bent_knees(model, [foot])
    assert [model.joint(joint).name for joint in joints] == ["knee"]
    straight = knee_of(model, foot)[1]
    bent = (lower if folds > 0 else upper)[0]
    assert bent == pytest.approx(straight + folds * BENT)
    assert (upper if folds > 0 else lower)[0] == pytest.approx(folds * np.radians(150.0))


def test_a_knee_that_cannot_straighten_so_far_keeps_its_ends():
    model, foot = leg(0.0, ends="range='20 150' limited='true'")
    _, lower, upper = bent_knees(model, [foot])
    assert np.degrees([lower[0], upper[0]]) == pytest.approx([20.0, 150.0])


def test_a_leg_without_a_hinge_for_a_knee_has_none():
    robot = load_robot(ROBOTS / "mannequin.toml", human())
    model = physics_model(robot, "free")
    feet = [int(model.body(foot.body).id) for foot in feet_of(robot)]
    assert [knee_of(model, foot) for foot in feet] == [None, None]
    assert [len(found) for found in bent_knees(model, feet)] == [0, 0, 0]


def test_servo20_bends_its_knees():
    robot = load_robot(ROBOTS / "servo20.toml", human())
    model = physics_model(robot, "free")
    joints, lower, _ = bent_knees(model, [int(model.body(foot.body).id) for foot in feet_of(robot)])
    assert {model.joint(joint).name for joint in joints} == {"r_knee", "l_knee"}
    assert lower == pytest.approx(BENT)
