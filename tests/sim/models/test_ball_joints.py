"""Tests of the hinges that take the place of ball joints."""

import re

import mujoco
import numpy as np
import pytest

from sim.models.model_file import read_model
from small_robots import calibrated, full_humanoid, urdf

JOINTS = [f"{side}_{joint}" for side in ("left", "right") for joint in ("hip", "shoulder")]


def on_balls(actuators="", **build):
    """A humanoid whose hips and shoulders are ball joints; actuators: of each, by their gears."""
    text = full_humanoid(fingers=False, **build)
    for name in JOINTS:
        for kind in ("pitch", "roll", "yaw"):
            hinge = rf'<joint name="{name}_{kind}_joint"[^>]*/>'
            text = re.sub(hinge, f'<joint name="{name}" type="ball" damping="0.3"/>' if kind == "pitch" else "", text)
            text = re.sub(f'<position name="{name}_{kind}_joint"[^>]*/>', "", text)
    motors = "".join(f'<motor joint="{name}" gear="{gear}"/>' for name in JOINTS for gear in actuators.split(","))
    return text.replace("<actuator>", f"<actuator>{motors}", 1) if actuators else text


def model_of(tmp_path, text, name="robot.xml"):
    (tmp_path / name).write_text(text)
    return read_model(tmp_path / name).compile()


@pytest.mark.parametrize("build", [{}, {"spread": np.pi / 2}, {"spread": 0.8}, {"lying": True}], ids=str)
def test_a_ball_that_actuators_drive_becomes_three_hinges_that_turn_any_way(tmp_path, build):
    model = model_of(tmp_path, on_balls("50 0 0 0 0 0,0 50 0 0 0 0,0 0 50 0 0 0", **build))
    played = {model.actuator(k).name for k in range(model.nu)}
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    side = np.array([0.0, 1.0, 0.0]) if "lying" not in build else np.array([1.0, 0.0, 0.0])
    for name in JOINTS:
        three = [model.joint(f"{name}_{word}").id for word in ("pitch", "roll", "yaw")]
        assert {model.joint(joint).name for joint in three} <= played
        first, second, third = data.xaxis[three]
        # Neighbours at right angles turn a body any way; the first goes from side to side, the last along the limb.
        assert first @ second == pytest.approx(0.0, abs=1e-9)
        assert second @ third == pytest.approx(0.0, abs=1e-9)
        assert abs(first @ side) == pytest.approx(1.0, abs=1e-6)
        assert np.ptp(data.xanchor[three], axis=0) == pytest.approx(0.0)
        assert model.dof_damping[model.jnt_dofadr[three]] == pytest.approx(0.3)


def test_a_robot_on_balls_is_calibrated_as_the_one_on_hinges(tmp_path):
    for name, text in (("balls.xml", on_balls("50 0 0 0 0 0")), ("hinges.xml", full_humanoid(fingers=False))):
        (tmp_path / name).write_text(text)
    balls, hinges = calibrated(tmp_path / "balls.xml"), calibrated(tmp_path / "hinges.xml")
    assert balls.sound
    assert balls.unplayed == ()
    for part in ("l_shank", "r_foot", "l_forearm", "r_hand", "head"):
        assert balls.parts[part] == hinges.parts[part]
    assert max(balls.missed.values()) < 0.02


def test_a_ball_that_nothing_drives_stays_and_a_limb_on_it_is_an_error(tmp_path):
    (tmp_path / "limp.xml").write_text(on_balls())
    found = calibrated(tmp_path / "limp.xml")
    assert set(found.unplayed) == set(JOINTS)
    assert any("drives the ball joint 'left_hip'" in doubt.words and doubt.fatal for doubt in found.doubts)


def test_balls_of_a_file_without_actuators_are_all_played(tmp_path):
    model = model_of(tmp_path, re.sub("<actuator>.*</actuator>", "", on_balls()))
    assert not (model.jnt_type == mujoco.mjtJoint.mjJNT_BALL).any()
    assert model.nu == model.njnt - 1


def test_a_urdf_may_limit_its_spherical_joints(tmp_path):
    text = urdf().replace('<joint name="l_hip" type="revolute">', '<joint name="l_hip" type="spherical">')
    model = model_of(tmp_path, text, "legs.urdf")
    for word in ("pitch", "roll", "yaw"):
        assert model.joint(f"l_hip_{word}").range == pytest.approx([-2.0, 2.0])
    assert model.nu == 8


def test_hinges_without_a_name_to_go_by_and_with_a_taken_one_get_others(tmp_path):
    text = on_balls("50 0 0 0 0 0").replace('name="left_knee"', 'name="left_hip_yaw"')
    text = text.replace('joint="left_knee"', 'joint="left_hip_yaw"')
    assert model_of(tmp_path, text).joint("left_hip_yaw_").type == mujoco.mjtJoint.mjJNT_HINGE
    bare = re.sub(
        r'<joint name="\w+" type="ball"', '<joint type="ball"', re.sub("<actuator>.*</actuator>", "", on_balls())
    )
    assert model_of(tmp_path, bare).joint("left_hip_pitch_roll").id > 0
