import numpy as np
import pytest

from motiondeck_base.errors import FileFormatError, UnknownNameError
from sim.retargeting.retarget import SERVO_HUMANOID_JOINTS
from sim.robots.robot import load_robot
from simulated_bodies import HUMAN, ROBOTS, human, skeleton_of

GOOD = """
name = "mannequin"
kind = "mannequin"
[limits]
velocity = 30.0
acceleration = 1500.0
jerk = 150000.0
"""


def load(tmp_path, text):
    file = tmp_path / "robot.toml"
    file.write_text(text)
    return load_robot(file, human())


@pytest.mark.parametrize("name", ["mannequin", "servo20"])
def test_the_robots_that_come_along_load(name):
    robot = load_robot(ROBOTS / f"{name}.toml", human())
    assert robot.name == name
    count = len(robot.joints)
    assert robot.model.nu == count
    limits = robot.limits
    assert robot.rest.shape == (count,)
    assert np.all((limits.lower <= robot.rest) & (robot.rest <= limits.upper))
    for bound in (limits.velocity, limits.acceleration, limits.jerk):
        assert bound.shape == (count,)
        assert np.all(bound > 0.0)


def test_the_mannequin_has_three_coordinates_a_bone():
    robot = load_robot(ROBOTS / "mannequin.toml", human())
    assert robot.joints == tuple(f"{bone}.{axis}" for bone in human().bones for axis in "xyz")
    assert robot.path_scale == 1.0


def test_servo20_has_its_twenty_joints_in_order_its_size_and_its_weight():
    robot = load_robot(ROBOTS / "servo20.toml", human())
    assert robot.joints == SERVO_HUMANOID_JOINTS
    assert len(robot.joints) == 20
    assert 2.5 < robot.model.body_mass.sum() < 3.5
    assert robot.path_scale == pytest.approx(0.24 / human().leg_length)


def test_a_joint_may_differ_from_the_others(tmp_path):
    robot = load(tmp_path, GOOD + '[limits.joints."head.x"]\nvelocity = 2.0\nlower = -0.3\n[rest]\n"lelb.x" = 1.2\n')
    joint = robot.joints.index("head.x")
    assert robot.limits.velocity[joint] == 2.0
    assert robot.limits.lower[joint] == -0.3
    assert np.all(np.delete(robot.limits.velocity, joint) == 30.0)
    assert robot.rest[robot.joints.index("lelb.x")] == 1.2


@pytest.mark.parametrize(
    ("text", "error", "complaint"),
    [
        (
            GOOD.replace("kind =", "knid ="),
            FileFormatError,
            r"robot.toml line 3: unknown key 'knid'.*Did you mean 'kind'.*Allowed are: angles, groups, kind",
        ),
        (GOOD.replace("jerk", "jolt"), FileFormatError, r"'jolt' in \[limits\].*Allowed are: acceleration, jerk"),
        (
            GOOD + "[limits.joints.lelb]\nspeed = 1\n",
            FileFormatError,
            r"'speed' in \[limits\.joints.*acceleration, jerk, lower",
        ),
        (GOOD + "[rest]\nlelbow = 1.0\n", UnknownNameError, r"rest: unknown joint 'lelbow'"),
        (GOOD + '[rest]\n"lelb.x" = 9.0\n', FileFormatError, r"rest\.lelb\.x is 9.0, outside"),
        (GOOD + '[rest]\n"lelb.x" = nan\n', FileFormatError, r"rest\.lelb\.x is nan"),
        (
            GOOD + '[limits.joints."lelb.x"]\nlower = 2.0\nupper = 1.0\n',
            FileFormatError,
            "lower must be less than upper",
        ),
        (GOOD.replace("30.0", "-1.0"), FileFormatError, r"line 5: .* of at least 0\.001 in \[limits\.velocity\]"),
        (GOOD.replace("30.0", '"fast"'), FileFormatError, r"robot\.toml line 5: .*limits\.velocity"),
        (GOOD.replace("30.0", "inf"), FileFormatError, r"limits\.velocity is inf"),
        (GOOD.replace('"mannequin"\n[', '"dog"\n['), FileFormatError, r"robot\.toml line 3: .*dog"),
        (GOOD.replace("[limits]", "root_height = 0\n[limits]"), FileFormatError, r"0\.001 in \[root_height\]"),
        (GOOD.replace("[limits]", 'model = "x.xml"\n[limits]'), FileFormatError, "built, not loaded"),
        (GOOD.replace('kind = "mannequin"', 'kind = "humanoid"'), FileFormatError, "needs its MJCF or URDF file"),
        (
            GOOD.replace('kind = "mannequin"', 'kind = "humanoid"\nmodel = "no.xml"'),
            FileFormatError,
            r"robot\.toml: its model .*no\.xml is missing; put it there, or correct `model`",
        ),
        (GOOD + "[", FileFormatError, r"robot\.toml: not valid TOML"),
    ],
)
def test_a_bad_robot_file_is_refused_with_its_place(tmp_path, text, error, complaint):
    with pytest.raises(error, match=complaint):
        load(tmp_path, text)


def test_a_missing_robot_file_is_named(tmp_path):
    with pytest.raises(FileFormatError, match=r"missing\.toml: there is no such robot file"):
        load_robot(tmp_path / "missing.toml", human())


@pytest.mark.parametrize(
    "model", ["<mujoco", "<mujoco/>", "<mujoco><worldbody><body><joint/></body></worldbody></mujoco>"]
)
def test_a_model_that_mujoco_cannot_use_is_named(tmp_path, model):
    (tmp_path / "bad.xml").write_text(model)
    with pytest.raises(FileFormatError, match=r"bad\.xml"):
        load(tmp_path, GOOD.replace('kind = "mannequin"', 'kind = "humanoid"\nmodel = "bad.xml"'))


def test_a_body_without_arms_cannot_play_on_the_servo_humanoid():
    legs_only = skeleton_of([bone for bone in HUMAN if bone[0][1:] in ("hip", "kne", "ank", "foo")])
    with pytest.raises(FileFormatError, match="no right upper arm"):
        load_robot(ROBOTS / "servo20.toml", legs_only)
