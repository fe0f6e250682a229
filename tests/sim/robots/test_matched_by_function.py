"""Knees and elbows are found by what they do, however a file names, places and covers the bodies around them."""

import mujoco
import numpy as np
import pytest

from motiondeck.cli.robot.calibration import BETTER, decided, off_reach
from sim.models.joint_layout import JointLayout
from sim.models.model_file import read_model
from sim.models.surface import BEYOND, LowestPoint, Surface
from sim.retargeting.robot_limbs import RobotLimbs
from sim.robots.body_matching import match
from sim.robots.calibrate import calibrate
from sim.robots.limb_directions import LimbDirections
from sim.robots.proportions import limb_doubts, segments_of
from small_robots import ARM, humanoid

FORE = '<geom type="capsule" fromto="0 0 0 0 0 -0.15" size="0.02"/>\n    </body>\n  </body>\n</body>'
ROD = '<inertial pos="0 0 -0.075" mass="0.3" diaginertia="0.0006 0.0006 0.00006"/>'
BALL = '<geom size="0.025"/>'
LOOK = '<geom type="capsule" fromto="0 0 0 0 0 -0.15" size="0.02" contype="0" conaffinity="0" mass="0"/>'


def with_forearms(solids):
    assert FORE in ARM
    return humanoid().replace(FORE, FORE.replace(FORE.partition("\n")[0], solids))


def with_wide_shoulders():
    """The second hinge of a shoulder lies 0.12 m out along the axis of the first one."""
    text = humanoid()
    for side, y in (("left", 0.12), ("right", -0.12)):
        text = text.replace(f'<body name="{side}_upper">', f'<body name="{side}_upper" pos="0 {y} 0">')
    return text


def with_a_long_axis():
    """As before, but the file has the first hinge at the neck, so no link lies between the two."""
    text = humanoid()
    for side, y in (("left", -0.13), ("right", 0.13)):
        was = f'<joint name="{side}_arm_pitch"'
        text = text.replace(was, f'{was} pos="0 {y} 0"')
    return text


def with_odd_names():
    text = humanoid()
    for was, becomes in (("elbow", "wrist"), ("arm_roll", "elbow"), ("knee", "ankle_2"), ("hip_yaw", "knee")):
        text = text.replace(f"left_{was}", f"left_{becomes}").replace(f"right_{was}", f"right_{becomes}")
    return text


def found_in(path):
    """The robot's segments by part, and what is implausible about them."""
    model = read_model(path).compile()
    parts = match(path, model)
    limbs = RobotLimbs(path, model, parts.parts, parts.root_rotation, JointLayout.of(model).joints)
    segments = segments_of(model, parts.parts, limbs, 0.9)
    directions = LimbDirections(model, parts.parts, parts.root_rotation)
    fatal = [doubt.words for doubt in limb_doubts(parts.parts, segments, directions) if doubt.fatal]
    return {segment.part: segment for segment in segments}, fatal


@pytest.mark.parametrize(
    ("text", "elbow", "knee"),
    [
        (humanoid(), "elbow", "knee"),  # without a waist
        (with_forearms(BALL + ROD), "elbow", "knee"),
        (with_forearms(BALL + ROD.replace("-0.075", "0.0") + LOOK), "elbow", "knee"),
        (with_forearms(ROD), "elbow", "knee"),
        (with_wide_shoulders(), "elbow", "knee"),
        (with_a_long_axis(), "elbow", "knee"),
        (with_odd_names(), "wrist", "ankle_2"),
    ],
    ids=["plain", "bumper at the elbow", "bumper and look", "inertia alone", "wide", "long axis", "odd names"],
)
def test_knees_and_elbows_are_found_by_what_they_do(tmp_path, text, elbow, knee):
    (tmp_path / "small.xml").write_text(text)
    segments, fatal = found_in(tmp_path / "small.xml")
    assert segments["forearm"].hinge == (f"right_{elbow}", f"left_{elbow}")
    assert segments["shank"].hinge == (f"right_{knee}", f"left_{knee}")
    assert segments["forearm"].length == pytest.approx([0.15, 0.15], abs=0.03)
    assert segments["upper_arm"].length == pytest.approx([0.15, 0.15], abs=0.01)
    assert fatal == []


def test_a_solid_that_ends_at_the_centre_of_mass_is_no_skin_of_its_own(tmp_path):
    reaches = {}
    for name, solids in (
        ("ball", BALL + ROD),
        ("rod", ROD),
        ("capsule", '<geom type="capsule" fromto="0 0 0 0 0 -.15" size=".02"/>'),
    ):
        (tmp_path / "small.xml").write_text(with_forearms(solids))
        model = read_model(tmp_path / "small.xml").compile()
        skin = Surface.of(model).part(np.array([model.body("left_fore").id]))
        reaches[name] = float((skin.centre[:, 2] - skin.radius).min())
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        floor = LowestPoint(model)(data)
        assert floor == pytest.approx(0.07, abs=1e-6)  # contacts are the file's
    assert reaches["capsule"] == pytest.approx(-0.17)
    assert reaches["ball"] == reaches["rod"] == pytest.approx(-0.15, abs=0.01)
    assert -reaches["ball"] > BEYOND * 0.075


def with_a_high_shoulder():
    """A shoulder that rolls first and pitches 0.1 m above that: by its axes this could be the elbow."""
    text = humanoid()
    for side in ("left", "right"):
        text = text.replace(f'name="{side}_arm_pitch" axis="0 1 0"', f'name="{side}_arm_pitch" axis="1 0 0"')
        text = text.replace(f'name="{side}_arm_roll" axis="1 0 0"', f'name="{side}_arm_roll" axis="0 1 0"')
        text = text.replace(f'<body name="{side}_upper">', f'<body name="{side}_upper" pos="0 0 0.1">')
    return text


@pytest.mark.thorough
def test_where_axes_and_folding_disagree_hands_that_walk_and_box_decide(tmp_path):
    path = tmp_path / "high.xml"
    path.write_text(with_a_high_shoulder())
    by_axes = calibrate(path)
    found = decided(path, {})
    hinges = [{s.part: s.hinge[1] for s in one.segments}["forearm"] for one in (by_axes, found)]
    assert hinges == ["left_arm_roll", "left_elbow"]
    assert by_axes.rivals == {"leg": [], "arm": [("right_elbow", "left_elbow")]}
    assert found.sound
    off = [off_reach(one)["arm"] for one in (by_axes, found)]
    assert off[1] < BETTER * off[0]


def with_a_long_hand():
    """A wrist that bends halfway between the elbow and the end of a long hand, as in the G1."""
    text = humanoid()
    for side in ("left", "right"):
        fore = f'<joint name="{side}_elbow" axis="0 -1 0" range="0 2.5"/>'
        hand = (
            f'<body name="{side}_hand" pos="0 0 -0.12"><joint name="{side}_wrist" axis="0 -1 0" range="-1.5 1.5"/>'
            '<geom type="capsule" fromto="0 0 0 0 0 -0.14" size="0.02"/></body>'
        )
        text = text.replace(fore, fore + hand)
    actuators = "".join(f'<position name="{s}_wrist" joint="{s}_wrist" kp="20"/>' for s in ("left", "right"))
    return text.replace("</actuator>", actuators + "</actuator>")


@pytest.mark.thorough
def test_a_hand_as_long_as_the_forearm_keeps_its_elbow(tmp_path):
    path = tmp_path / "hand.xml"
    path.write_text(with_a_long_hand())
    found = calibrate(path)
    assert found.rivals["arm"] == [("right_wrist", "left_wrist")]
    assert {s.part: s.hinge[1] for s in decided(path, {}).segments}["forearm"] == "left_elbow"
    wrong = calibrate(path, bends=["left_wrist", "right_wrist"])
    assert off_reach(wrong)["arm"] > BETTER * off_reach(found)["arm"]
