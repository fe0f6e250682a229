"""Tests of the rest pose: elbows and knees bend from it as a human's do."""

import numpy as np
import pytest

from controller.deck.interfaces import JointLimits
from sim.models.model_file import read_model
from sim.retargeting.human_limbs import LIMBS
from sim.retargeting.inverse_kinematics import LimbSolver
from sim.retargeting.robot_limbs import RobotLimbs, limb_directions
from sim.robots.calibrate import standing_human
from small_robots import calibrated, full_humanoid

UP = np.array([0.0, 0.0, 1.0])


def turned_round(text, side):
    """The elbow bends backwards only: the arm can bend forwards if the shoulder turns it by half a turn."""
    elbow = f'<joint name="{side}_elbow" axis="0 1 0" range="-2.5 2.5"/>'
    yaw = f'<joint name="{side}_shoulder_yaw_joint" axis="0 0 1" range="-2.5 2.5"/>'
    assert elbow in text
    assert yaw in text
    return text.replace(elbow, elbow.replace("-2.5 2.5", "0 2.5")).replace(yaw, yaw.replace("-2.5 2.5", "-3.1 3.1"))


def test_an_arm_that_hangs_the_wrong_way_round_is_turned_until_its_elbow_bends_forwards(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(turned_round(full_humanoid(), "left"))
    calibration = calibrated(path)
    rest = dict(zip(calibration.joints, calibration.rest.tolist(), strict=True))
    assert abs(rest["left_shoulder_yaw_joint"]) > 1.5
    assert abs(rest["right_shoulder_yaw_joint"]) < 0.5
    model = read_model(path).compile()
    limbs = RobotLimbs(path, model, calibration.parts, calibration.root_rotation, calibration.joints)
    lower, upper = model.jnt_range[[model.joint(name).id for name in calibration.joints]].T
    limits = JointLimits(lower, upper, *(np.full(len(lower), rate) for rate in (10.0, 300.0, 15000.0)))
    bent = standing_human()
    rows = [LIMBS.index(f"{name}_forearm") for name in "rl"]
    bent[rows] = [1.0, 0.0, 0.0]
    limbs.place(LimbSolver(limbs, limits, calibration.rest, 1.0)(bent, UP))
    assert limb_directions(limbs)[rows] == pytest.approx(bent[rows], abs=0.1)
