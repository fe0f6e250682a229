"""Tests of what slope the foot bones of a human have while the feet stand flat."""

import numpy as np
import pytest

from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.clip import Clip
from controller.motion.rest_pose import FOOT_SLOPE
from motiondeck_base.shipped import find_robot
from sim.retargeting.human_limbs import LIMBS, LimbView
from sim.retargeting.human_stance import FlatFeet
from sim.robots.fidelity import carry
from sim.robots.robot import load_robot
from simulated_bodies import bent_pose, human

DT = 0.01
FEET = [LIMBS.index("r_foot"), LIMBS.index("l_foot")]


def feet_at(slope, **more):
    return bent_pose(human(), **dict.fromkeys(("rfoo", "lfoo"), (0.0, slope, 0.0)), **more)


def standing_clip(slope, count=40):
    poses = [feet_at(slope)] * count
    return Clip(
        "stand", human(), 1.0 / DT, np.array([p.root_position for p in poses]), np.array([p.rotation for p in poses])
    )


@pytest.mark.parametrize("slope", [0.04, 0.3, 0.69])
def test_feet_that_stand_flat_do_so_whatever_their_bones_slope(slope):
    flat, view = FlatFeet(DT), LimbView(human())
    flat.learn(standing_clip(slope))
    assert flat.slope == pytest.approx([slope, slope], abs=1e-6)
    feet = flat(view(feet_at(slope)))[FEET]
    assert np.arcsin(-feet[:, 2]) == pytest.approx(FOOT_SLOPE, abs=1e-6)
    # A foot that is pitched by so much more is so afterwards too.
    feet = flat(view(feet_at(slope + 0.2)))[FEET]
    assert np.arcsin(-feet[:, 2]) == pytest.approx(FOOT_SLOPE + 0.2, abs=1e-6)


@pytest.mark.parametrize("slope", [0.04, 0.69])
def test_while_a_motion_plays_the_slope_is_found_too(slope):
    clip = standing_clip(slope, 400)
    robot = load_robot(find_robot("servo20"), clip.skeleton, dt=DT)
    pose, qpos = feet_at(slope), np.zeros(robot.model.nq)
    for _ in range(len(clip)):
        robot.place(robot.retarget(pose), pose, qpos)
    assert robot.footing.stance.flat.slope == pytest.approx([slope, slope], abs=0.02)


def test_a_moment_on_tiptoe_is_not_taken_for_flat():
    flat = FlatFeet(DT)
    for _ in range(20):
        flat.stood(0, FOOT_SLOPE + 0.6)
    assert flat.slope[0] < FOOT_SLOPE + 0.15
    assert flat.slope[1] == FOOT_SLOPE


def test_feet_that_never_stand_tell_nothing():
    clip = standing_clip(0.6)
    running = clip.root_position + np.array([3.0 * DT, 0.0, 0.0]) * np.arange(len(clip))[:, None]
    flat = FlatFeet(DT)
    flat.learn(Clip("run", clip.skeleton, clip.rate, running, clip.rotation))
    assert flat.slope == [FOOT_SLOPE, FOOT_SLOPE]


def test_the_robots_soles_are_flat_where_the_humans_are():
    clip = standing_clip(0.69)
    robot = load_robot(find_robot("servo20"), clip.skeleton, dt=DT)
    played = carry(clip, robot, SafetyEnvelope).played[-1]
    pitch = {name: played[robot.joints.index(name)] for name in ("r_hip_pitch", "r_knee", "r_ankle_pitch")}
    assert sum(pitch.values()) == pytest.approx(0.0, abs=0.05)
