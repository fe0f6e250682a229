"""Tests of the angles between a robot's limbs and a human's, and of what does not fit a human's proportions."""

import re

import mujoco
import numpy as np
import pytest

from sim.models.kinematic_tree import below, hinges_between
from sim.models.limb_geometry import centre_of, end_hinge, level_with
from sim.models.model_file import read_model
from sim.retargeting.human_limbs import LIMBS
from sim.robots.body_matching import match
from sim.robots.calibrate import calibrate, standing_human
from sim.robots.limb_directions import LimbDirections, beyond_limits
from sim.robots.proportions import unit_doubts
from small_robots import full_humanoid, humanoid

LENGTHS = re.compile(r'(pos|size|fromto)="([^"]*)"')
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def in_millimetres(numbers):
    return " ".join(f"{1000.0 * float(number):g}" for number in numbers.split())


def loaded(tmp_path, text):
    path = tmp_path / "robot.xml"
    path.write_text(text)
    model = read_model(path).compile()
    return model, match(path, model)


@pytest.fixture
def robot(tmp_path):
    model, found = loaded(tmp_path, full_humanoid())
    return model, LimbDirections(model, found.parts, found.root_rotation)


@pytest.mark.parametrize(
    "build",
    [{}, {"lying": True}, {"hip": "yaw roll pitch", "wrist": "", "fingers": False}, {"rods": True, "waist": ""}],
    ids=str,
)
def test_folding_a_limb_finds_the_same_knees_and_elbows_as_the_axes(tmp_path, build):
    model, found = loaded(tmp_path, full_humanoid(**build))
    directions = LimbDirections(model, found.parts, found.root_rotation)
    joints = {segment.name: segment.joint for segment in directions.segments}
    for side, name in (("l", "left"), ("r", "right")):
        assert joints[f"{side}_thigh"] == joints[f"{side}_shank"] == f"{name}_knee"
        assert joints[f"{side}_upper_arm"] == joints[f"{side}_forearm"] == f"{name}_elbow"


def test_hanging_limbs_point_down(robot):
    _, directions = robot
    qpos = np.zeros(directions.model.nq)
    qpos[3] = 1.0
    assert directions(qpos) == pytest.approx(np.tile([0.0, 0.0, -1.0], (8, 1)), abs=1e-6)


@pytest.mark.parametrize("turned", [0.0, 0.9])
def test_a_bent_knee_turns_the_shank_only_and_a_waist_no_arm(robot, turned):
    model, directions = robot
    data = mujoco.MjData(model)
    data.joint("left_knee").qpos[0] = 0.7
    data.joint("waist_pitch_joint").qpos[0] = 0.4
    data.qpos[3:7] = [np.cos(turned), 0.0, 0.0, np.sin(turned)]  # which way the whole robot faces is no matter
    names = [segment.name for segment in directions.segments]
    there = dict(zip(names, directions(data.qpos), strict=True))
    assert there["l_thigh"] == pytest.approx([0, 0, -1], abs=1e-6)
    # Legs are seen from the pelvis, arms from the chest, which goes with the waist.
    frame = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert there["l_shank"] == pytest.approx(frame @ [-np.sin(0.7), 0.0, -np.cos(0.7)], abs=1e-6)
    assert there["r_upper_arm"] == pytest.approx([0, 0, -1], abs=1e-6)


def test_errors_are_the_angles_between_the_two(robot):
    model, directions = robot
    qpos = np.zeros((3, model.nq))
    qpos[:, 3] = 1.0
    limbs = np.zeros((3, len(LIMBS), 3))
    limbs[:] = [0.0, 0.0, -1.0]
    angles = np.array([0.0, 0.2, 0.7])
    limbs[:, LIMBS.index("r_shank")] = np.stack([-np.sin(angles), 0 * angles, -np.cos(angles)], axis=1)
    degrees = dict(
        zip((segment.name for segment in directions.segments), directions.degrees(qpos, limbs).T, strict=True)
    )
    assert degrees["r_shank"] == pytest.approx(np.degrees([0.0, 0.2, 0.7]), abs=1e-4)
    assert degrees["l_shank"] == pytest.approx(np.zeros(3), abs=1e-4)


def test_a_trunk_is_as_far_off_as_its_line_from_hips_to_shoulders_is_from_the_humans(robot):
    model, directions = robot
    data = mujoco.MjData(model)
    data.joint("waist_pitch_joint").qpos[0] = 0.4
    mujoco.mj_kinematics(model, data)
    hips, shoulders = (data.joint(f"left_{name}_pitch_joint").xanchor for name in ("hip", "shoulder"))
    leans = np.arctan2(shoulders[0] - hips[0], shoulders[2] - hips[2])
    assert 0.2 < leans < 0.4
    limbs = np.zeros((2, len(LIMBS), 3))
    for frame, angle in enumerate((leans, leans - 0.3)):
        limbs[frame, LIMBS.index("chest_ahead")] = [np.cos(angle), 0.0, -np.sin(angle)]
    limbs[:, LIMBS.index("chest_left")] = [0.0, 1.0, 0.0]
    off = directions.trunk_errors(np.tile(data.qpos, (2, 1)), limbs)
    assert off == pytest.approx([0.0, np.degrees(0.3)], abs=1e-4)


def test_beyond_the_limits_is_more_than_15_on_average_or_45_at_worst():
    assert beyond_limits({"a": (15.0, 45.0)}) == []
    assert beyond_limits({"a": (15.1, 20.0), "b": (3.0, 45.1)}) == [
        "a 15 degrees on average, 20 at worst",
        "b 3 degrees on average, 45 at worst",
    ]


def test_a_hip_is_where_the_axes_across_the_thigh_meet(tmp_path):
    """Unitree's way: roll sits aside of pitch, and yaw, further down, turns about the thigh."""
    text = """<mujoco><worldbody><body name="p" pos="0 0 1"><freejoint/><geom size=".1"/>
      <body name="a"><joint name="pitch" axis="0 1 0"/><geom size=".01"/>
      <body name="b" pos="0 .05 -.03"><joint name="roll" axis="1 0 0"/><geom size=".01"/>
      <body name="c" pos=".04 0 -.1"><joint name="yaw" axis="0 0 1"/><geom size=".01"/>
      <body name="d" pos="-.04 .01 -.2"><joint name="knee" axis="0 1 0"/><geom size=".01"/></body>
      </body></body></body></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    hinges = [model.joint(name).id for name in ("pitch", "roll", "yaw")]
    knee = data.joint("knee").xanchor
    assert centre_of(data, hinges, knee) == pytest.approx([0.0, 0.05, 0.985], abs=1e-4)
    assert centre_of(data, hinges[1:], knee) == pytest.approx([0.0, 0.05, 0.97], abs=1e-4)
    assert centre_of(data, hinges[2:], knee) == pytest.approx(data.joint("yaw").xanchor)
    # Axes that pass each other far apart have no centre: then the last hinge's place stands for it.
    data.xanchor[hinges[0]] += [0.0, 0.0, 0.6]
    assert centre_of(data, hinges, knee) == pytest.approx([0.0, 0.05, 0.97], abs=1e-4)


def test_what_is_set_aside_along_a_knees_axis_is_no_part_of_the_limb():
    knee, axis = np.zeros(3), np.array([0.0, 1.0, 0.0])
    assert level_with(np.array([0.1, 0.2, 0.4]), knee, axis) == pytest.approx([0.1, 0.0, 0.4])
    assert level_with(np.array([0.1, 0.5, 0.4]), knee, axis) == pytest.approx([0.1, 0.5, 0.4])


def test_an_ankle_lies_across_and_far_enough_below_the_knee(tmp_path):
    model, _ = loaded(tmp_path, full_humanoid(wrist="yaw roll pitch"))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    hinges = hinges_between(model, model.body("left_fore").id, model.body("left_wrist_pitch").id)
    names = [model.joint(j).name for j in hinges]
    elbow = data.joint("left_elbow").xanchor
    assert names[:3] == ["left_wrist_yaw_joint", "left_wrist_roll_joint", "left_wrist_pitch_joint"]
    assert end_hinge(data, hinges, elbow, 0.2) == hinges[1]
    assert end_hinge(data, hinges, elbow, 0.3) == hinges[2]
    assert end_hinge(data, hinges, elbow, 1.0) is None


def test_below_is_what_hangs_from_a_body(tmp_path):
    model, _ = loaded(tmp_path, humanoid())
    names = {model.body(body).name for body in below(model, model.body("left_thigh").id)}
    assert names == {"left_thigh", "left_shank", "left_sole"}


@pytest.mark.parametrize(
    ("was", "becomes", "part", "words"),
    [
        ('"left_fore" pos="0 0 -0.1"', '"left_fore" pos="0 0 -0.03"', "l_upper_arm", "differ"),
        ('"{}_ankle_pitch" pos="0 0 -0.3"', '"{}_ankle_pitch" pos="0 0 -0.15"', "r_shank", "0.150 m long; a human"),
    ],
)
def test_what_does_not_fit_a_human_is_doubted(tmp_path, was, becomes, part, words):
    text = full_humanoid()
    for side in ("left", "right"):
        text = text.replace(was.format(side), becomes.format(side))
    (tmp_path / "robot.xml").write_text(text)
    found = calibrate(tmp_path / "robot.xml")
    assert any(doubt.part == part and words in doubt.words for doubt in found.doubts), found.doubts
    assert found.sound


def test_a_knee_with_the_range_of_the_other_way_round_is_doubted(tmp_path):
    path, knee = tmp_path / "robot.xml", 'name="left_knee" axis="0 1 0" range="0 2.4"'
    for text, words in (
        (humanoid(), ()),
        (humanoid().replace(knee, knee.replace("0 2.4", "-2.4 0")), ("'left_knee' turns from -2.40 to 0.00, not",)),
        # The same knee with its axis the other way round is as it should be.
        (humanoid().replace(knee, 'name="left_knee" axis="0 -1 0" range="-2.4 0"'), ()),
    ):
        path.write_text(text)
        said = [doubt.words for doubt in calibrate(path).doubts if "mirror" in doubt.words]
        assert len(said) == len(words)
        assert all(one.startswith(start) for one, start in zip(said, words, strict=True))


def test_a_humanoid_of_human_proportions_is_not_doubted(tmp_path):
    (tmp_path / "robot.xml").write_text(full_humanoid())
    found = calibrate(tmp_path / "robot.xml")
    assert found.doubts == ()
    assert found.sound
    assert [segment.part for segment in found.segments] == ["thigh", "shank", "upper_arm", "forearm"]
    assert np.allclose([segment.length for segment in found.segments], np.array([[0.3, 0.3, 0.2, 0.2]]).T, atol=0.01)
    assert len(standing_human()) == len(LIMBS)


def test_a_forearm_without_a_wrist_ends_amid_its_fingers(tmp_path):
    """Not at the tip of one: these fingers are spread ahead, the first by nothing, the other by 6 cm."""
    text = full_humanoid(wrist="").replace('finger1" pos="0.01 0', 'finger1" pos="0.06 0')
    model, found = loaded(tmp_path, text.replace('finger0" pos="0 0', 'finger0" pos="-0.06 0'))
    directions = LimbDirections(model, found.parts, found.root_rotation)
    ahead = {segment.name: segment.direction for segment in directions.segments}["l_forearm"]
    assert ahead == pytest.approx([0.0, 0.0, -1.0], abs=0.02)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (LENGTHS.sub(lambda at: f'{at[1]}="{in_millimetres(at[2])}"', full_humanoid()), r"\d{4}.\d\d m tall: lengths"),
        (full_humanoid().replace('<compiler angle="radian"', "<compiler"), "no more than 0.087 rad: .*are degrees"),
        (full_humanoid().replace('range="-2.5 2.5"', 'range="-140 140"'), "280 rad or more: .*are radians"),
    ],
    ids=["millimetres", "degrees for radians", "radians for degrees"],
)
def test_other_units_are_named(tmp_path, text, words):
    model, found = loaded(tmp_path, text)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    (doubt,) = unit_doubts(model, float(np.ptp(data.xpos[1:, 2])))
    assert doubt.fatal
    assert re.search(words, doubt.words)
    assert found.parts["l_shank"] == "left_shin"
