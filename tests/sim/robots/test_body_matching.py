"""Tests that limbs are found from the mechanics of humanoids with any order and number of hinges."""

import re

import mujoco
import numpy as np
import pytest

from controller.motion.rotations import rotate
from motiondeck_base.errors import FileFormatError
from sim.models.model_file import read_model
from sim.robots.body_matching import match
from small_robots import SERVOS, full_humanoid, humanoid

AXES = ("0 1 0", "1 0 0", "0 0 1")
JOINTS = {"l_shank": "left_knee", "l_forearm": "left_elbow", "r_shank": "right_knee", "r_forearm": "right_elbow"}


def matched(tmp_path, text):
    path = tmp_path / "robot.xml"
    path.write_text(text)
    model = read_model(path).compile()
    return match(path, model), model


def joints_at(model, body):
    return [model.joint(j).name for j in np.flatnonzero(model.jnt_bodyid == model.body(body).id)]


@pytest.mark.parametrize(
    "build",
    [
        {},
        {"hip": "yaw roll pitch", "ankle": "roll pitch", "shoulder": "roll pitch yaw"},
        {"hip": "roll yaw pitch", "waist": "pitch", "neck": "pitch roll yaw"},
        {"hip": "roll pitch", "waist": "", "shoulder": "pitch roll", "wrist": "", "fingers": False},
        {"waist": "roll yaw", "wrist": "yaw pitch roll", "ankle": "pitch"},
        {"wrist": "pitch yaw", "neck": ""},
        {"lying": True},
        {"lying": True, "waist": "", "fingers": False},
        {"rods": True},
        {"hung": True},
    ],
    ids=lambda build: " ".join(f"{k}={v}" for k, v in build.items()) or "as it is",
)
def test_knees_and_elbows_are_found_whatever_hinges_there_are(tmp_path, build):
    found, model = matched(tmp_path, full_humanoid(**build))
    for part, joint in JOINTS.items():
        assert joint in joints_at(model, found.parts[part])
    for side, name in (("l", "left"), ("r", "right")):
        assert found.parts[f"{side}_thigh"].startswith(f"{name}_hip") or found.parts[f"{side}_thigh"] == f"{name}_femur"
        assert found.parts[f"{side}_upper_arm"].startswith(f"{name}_shoulder")
        assert found.parts[f"{side}_foot"].startswith(f"{name}_ankle")
        hand = found.parts.get(f"{side}_hand")
        assert hand is None if not build.get("wrist", "pitch") else hand and hand.startswith(f"{name}_wrist")
    waist = f"waist_{build.get('waist', 'pitch').split()[-1]}" if build.get("waist", "x") else "base"
    upper, lower = ("chest", "pelvis") if not build.get("hung") else ("pelvis", "chest")
    assert (found.parts[upper], found.parts[lower]) == (waist, "base")
    assert ("head" in found.parts) == bool(build.get("neck", "x"))
    assert found.doubts == ()
    # Upright and facing x: what is up and ahead in the file points up and ahead.
    up, ahead = ([0, 1, 0], [0, 0, 1]) if build.get("lying") else ([0, 0, 1], [1, 0, 0])
    assert rotate(found.root_rotation, np.array(up, dtype=float)) == pytest.approx([0, 0, 1], abs=1e-6)
    assert rotate(found.root_rotation, np.array(ahead, dtype=float)) == pytest.approx([1, 0, 0], abs=1e-6)


@pytest.mark.parametrize(
    "build",
    [{"spread": 0.8}, {"spread": 1.5}, {"raised": 1.5}, {"spread": 0.8, "wrist": "roll yaw", "shoulder": "pitch roll"}],
    ids=["A", "T", "ahead", "A without a yaw"],
)
@pytest.mark.parametrize("lying", ["", '<body name="base" euler="0 3.1416 0"'], ids=["z up", "y up, facing -z"])
def test_elbows_are_found_however_the_arms_are_held(tmp_path, build, lying):
    """At 45 degrees the axes of twin elbows are square to each other, and arms ahead may pass for legs upside down."""
    text = full_humanoid(lying=bool(lying), **build).replace('<body name="base"', lying or '<body name="base"')
    found, model = matched(tmp_path, text)
    for part, joint in JOINTS.items():
        assert joint in joints_at(model, found.parts[part])


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("gauche", "droite"),
        ("links", "rechts"),
        ("sx", "dx"),
        ("migi2", "hidari13"),
        ("左", "右"),
        ("левая", "правая"),
        ("bal", "jobb"),
        ("left", "plain"),  # only one of a pair has a side
    ],
)
def test_sides_are_told_in_other_languages(tmp_path, left, right):
    """The feet of this robot say nothing; a name that says the other side turns it round."""
    text = full_humanoid().replace("left", left).replace("right", right).replace("plain_", "")
    text = text.replace('pos="0.04 0 -0.03" size="0.1', 'pos="0 0 -0.03" size="0.1')
    found, model = matched(tmp_path, text)
    side = "r" if left.startswith("migi") else "l"
    assert f"{left}_knee" in joints_at(model, found.parts[f"{side}_shank"])


def test_legs_without_ankles_face_the_way_in_which_their_knees_fold(tmp_path):
    """Their feet would say the other way: seen from the knee, what is behind it is not ahead of the ankle."""
    text = full_humanoid(ankle="", fingers=False).replace("left", "one").replace("right", "two")
    text = text.replace('pos="0.04 0 -0.03" size="0.1', 'pos="-0.04 0 -0.03" size="0.1')
    text = re.sub(r'(_knee" axis="0 1 0" range=)"[^"]*"', r'\1"0 2.4"', text)
    found, model = matched(tmp_path, text)
    assert "one_knee" in joints_at(model, found.parts["l_shank"])
    found, _ = matched(tmp_path, text.replace("0 2.4", "-2.4 2.4"))
    assert "tells ahead from behind" in found.doubts[0]


@pytest.mark.parametrize("build", [{}, {"lying": True}, {"waist": ""}], ids=str)
def test_the_one_arm_of_a_robot_is_found(tmp_path, build):
    found, model = matched(tmp_path, full_humanoid(arms=("left",), **build))
    assert "left_elbow" in joints_at(model, found.parts["l_forearm"])
    assert "r_upper_arm" not in found.parts
    assert found.parts["chest"] == ("base" if "waist" in build else "waist_pitch")


def test_the_head_is_what_carries_the_eyes(tmp_path):
    found, _ = matched(tmp_path, full_humanoid(eyes=True))
    assert found.parts["head"] == "neck_pitch"


@pytest.mark.parametrize("hinges", [1, 3])
def test_wings_that_reach_farther_than_the_arms_are_none(tmp_path, hinges):
    wings = "".join(
        f'<body name="{side}_wing" pos="-0.05 {y} 0.2">'
        + "".join(f'<joint name="{side}_wing_{k}" axis="{axis}"/>' for k, axis in enumerate(AXES[:hinges]))
        + f'<geom type="capsule" fromto="0 0 0 0 {6 * y} 0.2" size="0.01"/></body>'
        for side, y in (("left", 0.1), ("right", -0.1))
    )
    acts = [f"{side}_wing_{k}" for side in ("left", "right") for k in range(hinges)]
    found, _ = matched(tmp_path, humanoid(trunk=wings, servos=[*SERVOS, *acts]))
    assert (found.parts["l_upper_arm"], found.parts["r_forearm"]) == ("left_upper", "right_fore")


def test_a_trunk_on_a_waist_is_no_arm(tmp_path):
    text = full_humanoid(arms=(), neck="", waist="yaw roll")
    found, _ = matched(
        tmp_path, text.replace('<geom size="0.08" pos="0 0 0.1"/>', '<geom size="0.08" pos="0 0.1 0.1"/>')
    )
    assert found.parts["l_foot"] == "left_ankle_roll"
    assert not any("arm" in part for part in found.parts)


def test_bodies_and_joints_without_a_name_get_one(tmp_path):
    text = full_humanoid(fingers=False)
    expected, _ = matched(tmp_path, text)
    text = text.replace('body name="left_shin"', "body").replace('joint name="left_ankle_roll_joint"', "joint")
    text = text.replace('<position name="left_ankle_roll_joint" joint="left_ankle_roll_joint" kp="50"/>', "")
    found, model = matched(tmp_path, text.replace("</worldbody>", '<body name="body_4" mocap="true"/></worldbody>'))
    assert found.parts["l_shank"] in {model.body(k).name for k in range(1, model.nbody)} - {""}
    assert {part for part in expected.parts if expected.parts[part] != found.parts[part]} == {"l_shank"}
    assert all(model.joint(k).name for k in range(model.njnt))


TOES = (
    '<body name="{s}_toes" pos="0.11 0 -0.02"><joint name="{s}_toe" axis="0 1 0"/>'
    '<geom type="box" pos="0.02 0 0" size="0.02 0.03 0.01"/></body>'
)


def test_toes_move_no_foot_but_every_joint_of_the_ankle_does(tmp_path):
    """What TOES_SHARE tells apart: a second ankle joint 2 cm ahead, and toes 11 cm ahead of the ankle."""
    text = humanoid()
    for side in ("left", "right"):
        sole = text.index("<geom", text.index(f'name="{side}_ankle_roll"'))
        text = text[:sole] + TOES.format(s=side) + text[sole:]
    found, _ = matched(tmp_path, text)
    assert found.parts["l_foot"] == "left_sole"
    text = text.replace('pos="0.11 0 -0.02"', 'pos="0.02 0 -0.02"')
    found, _ = matched(tmp_path, text)
    assert found.parts["l_foot"] == "left_toes"


def on_a_base(base, limbs):
    return f'<mujoco><worldbody><body name="stand" pos="0 0 .5">{base}{limbs}</body></worldbody></mujoco>'


def quadruped(splay=0.0):
    """A dog, or a lizard: splayed thighs and shanks could stand on their sides as the limbs of a human."""
    legs = "".join(
        f'<body name="{name}" pos="{x} {0.1 * side} 0"><joint name="{name}_a" axis="1 0 0"/><geom size="0.03"/>'
        f'<body name="{name}_thigh"><joint name="{name}_b" axis="0 1 0"/>'
        f'<geom type="capsule" fromto="0 0 0 0 {splay * side} -.2" size="0.03"/>'
        f'<body name="{name}_shank" pos="0 {splay * side} -.2"><joint name="{name}_c" axis="0 1 0"/>'
        f'<geom type="capsule" fromto="0 0 0 0 {splay * side} -.2" size="0.02"/></body></body></body>'
        for name, x, side in (("FL", 0.2, 1.0), ("FR", 0.2, -1.0), ("RL", -0.2, 1.0), ("RR", -0.2, -1.0))
    )
    return on_a_base('<freejoint/><geom type="box" size=".25 .1 .05"/>', legs)


def spider():
    """The ant of Gymnasium: four limbs spread out flat, any two of which point down where it stands on its side."""
    legs = "".join(
        f'<body name="leg{k}"><geom type="capsule" fromto="0 0 0 {x} {y} 0" size=".08"/>'
        f'<body name="hip{k}" pos="{x} {y} 0"><joint name="hip{k}" axis="0 0 1"/>'
        f'<geom type="capsule" fromto="0 0 0 {x} {y} 0" size=".08"/>'
        f'<body name="foot{k}" pos="{x} {y} 0"><joint name="ankle{k}" axis="{-y} {x} 0" range="30 70"/>'
        f'<geom type="capsule" fromto="0 0 0 {2 * x} {2 * y} 0" size=".08"/></body></body></body>'
        for k, (x, y) in enumerate(((0.2, 0.2), (-0.2, 0.2), (-0.2, -0.2), (0.2, -0.2)))
    )
    return on_a_base('<freejoint/><geom size=".25"/>', legs)


def arms(count):
    text = "".join(
        f'<body name="arm{k}" pos="0 {0.3 * (k - 0.5)} 0.5"><joint name="a{k}" axis="0 0 1"/><geom size="0.05"/>'
        f'<body name="boom{k}"><joint name="b{k}" axis="0 1 0"/>'
        '<geom type="capsule" fromto="0 0 0 .4 0 .1" size=".03"/>'
        f'<body name="stick{k}" pos=".4 0 .1"><joint name="c{k}" axis="0 1 0"/>'
        '<geom type="capsule" fromto="0 0 0 .3 0 -.1" size=".03"/></body></body></body>'
        for k in range(count)
    )
    return on_a_base('<geom type="box" size=".1 .3 .5"/>', text)


def rover(limbs=""):
    wheels = "".join(
        f'<body name="caster{k}" pos="{x} {y} 0"><joint name="c{k}" axis="0 0 1"/><geom size="0.02"/>'
        f'<body name="wheel{k}" pos="0 0 -.05"><joint name="w{k}" axis="0 1 0"/>'
        '<geom type="cylinder" size="0.05 0.02" euler="90 0 0"/></body></body>'
        for k, (x, y) in enumerate(((0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2)))
    )
    return on_a_base('<freejoint/><geom type="box" size=".3 .3 .2" pos="0 0 .3"/>', wheels + limbs)


def hanging_arms():
    """They reach down nearly to the floor, as the arms of a robot on wheels that bends do."""
    return "".join(
        f'<body name="arm{k}" pos="0 {y} .5"><joint name="a{k}" axis="0 1 0"/><geom size="0.05"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03"/>'
        f'<body name="fore{k}" pos="0 0 -.3"><joint name="b{k}" axis="0 1 0"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -.25" size=".03"/></body></body>'
        for k, y in (("_l", 0.35), ("_r", -0.35))
    )


ARMS_ALONE = "".join(
    f'<body name="{side}_shoulder" pos="0 {y} .2"><joint name="{side}_shoulder_pitch" axis="0 1 0"/>'
    '<geom type="capsule" fromto="0 0 0 0 0 -.2" size=".03"/>'
    f'<body name="{side}_forearm" pos="0 0 -.2"><joint name="{side}_elbow" axis="0 1 0"/>'
    '<geom type="capsule" fromto="0 0 0 0.02 0 -.2" size=".02"/></body></body>'
    for side, y in (("left", 0.15), ("right", -0.15))
)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (quadruped(), r"4 limbs stand on the floor.*'FL' \(3 hinges\)"),
        (quadruped(splay=0.2), r"4 limbs stand on the floor.*'FL' \(3 hinges\)"),
        (spider(), r"no two limbs.*'leg0' \(2 hinges\), 'leg1' \(2 hinges\)"),
        (arms(1), r"'stand' \(3 hinges\)"),
        (arms(2), r"'arm0' \(3 hinges\), 'arm1' \(3 hinges\)"),
        (rover(), r"it stands on wheels \(wheel0, wheel1, wheel2, wheel3\).*'caster0' \(2 hinges\)"),
    ],
    ids=["dog", "lizard", "spider", "arm", "two arms", "wheels"],
)
def test_what_is_no_humanoid_is_refused_in_one_line_with_what_was_found(tmp_path, text, found):
    with pytest.raises(FileFormatError, match=f"robot.xml: this is not a humanoid with two legs.*{found}") as error:
        matched(tmp_path, text)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", [on_a_base("<freejoint/>", ARMS_ALONE), rover(hanging_arms())])
def test_two_arms_without_legs_are_an_upper_body(tmp_path, text):
    found, _ = matched(tmp_path, text)
    assert {part for part in found.parts if part[1] == "_"} == {
        f"{side}_{part}" for side in "lr" for part in ("upper_arm", "forearm")
    }
    assert found.parts["pelvis"] == found.parts["chest"] == "stand"
    assert found.parts["l_upper_arm"] in ("left_shoulder", "arm_l")


def test_legs_on_balls_that_nothing_drives_are_refused_with_a_remedy(tmp_path):
    hips = r'<joint name="(\w+hip_pitch)_joint" [^>]*/>'
    text = re.sub(hips, r'<joint name="\1" type="ball"/>', full_humanoid(hip="pitch"))
    text = re.sub(r'<position name="\w+hip_pitch_joint"[^>]*/>', "", text)
    text = re.sub(r'<joint name="(\w+ankle_\w+)" [^>]*/>', "", re.sub(r'<position name="\w+ankle[^>]*/>', "", text))
    with pytest.raises(FileFormatError, match=r"ball joints \('left_hip_pitch' and 1 more\).*give them some"):
        matched(tmp_path, text)


def test_feet_that_stick_out_behind_are_doubted(tmp_path):
    text = full_humanoid().replace("left", "other").replace("right", "left").replace("other", "right")
    found, _ = matched(tmp_path, text)
    assert "feet stick out behind" in found.doubts[0]


def test_the_model_stays_as_it_was(tmp_path):
    _, model = matched(tmp_path, full_humanoid())
    assert mujoco.MjData(model).qpos[2] == pytest.approx(0.7)
