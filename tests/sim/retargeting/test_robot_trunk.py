"""How a robot's pelvis and waist follow a human's trunk, by joint points."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.motion.rotations import from_matrix, from_rotation_vector, multiply
from controller.motion.skeleton import Pose
from sim.retargeting.human_limbs import LIMBS, LimbView
from sim.retargeting.robot_trunk import STIFF, RobotTrunk, Waist
from simulated_bodies import HUMAN, bent_pose, human, random_pose, skeleton_of

PITCHES = Waist(np.array([[0.0, 1.0, 0.0]]), np.array([-0.2]), np.array([0.3]), np.array([0.02, 0.0, 0.1]), STIFF.above)
SEEDS = st.integers(0, 2**32 - 1)


def points(pose):
    joints = human().joints(pose.root_position, pose.rotation)
    return {name: joints[1 + bone] for bone, name in enumerate(human().bones)}


def line_of(pose):
    at = points(pose)
    line = at["rsho"] + at["lsho"] - at["rhip"] - at["lhip"]
    return line / np.linalg.norm(line)


@given(SEEDS)
@settings(max_examples=40, deadline=None)
def test_limbs_point_from_joint_to_joint_in_the_world(seed):
    pose = random_pose(human(), np.random.default_rng(seed), 0.6)
    at, found = points(pose), dict(zip(LIMBS, LimbView(human())(pose), strict=True))
    for name, start, end in (("r_thigh", "rhip", "rkne"), ("l_shank", "lkne", "lank"), ("l_forearm", "lelb", "lwri")):
        way = at[end] - at[start]
        assert found[name] == pytest.approx(way / np.linalg.norm(way), abs=1e-9)
    assert np.cross(found["chest_ahead"], found["chest_left"]) == pytest.approx(line_of(pose), abs=0.01)
    across = at["lsho"] - at["rsho"]
    assert found["chest_left"] @ across > 0.0
    assert found["chest_ahead"] @ across == pytest.approx(0.0, abs=0.01)


@given(SEEDS)
@settings(max_examples=40, deadline=None)
def test_a_robots_trunk_has_the_humans_line_whatever_its_waist(seed):
    pose = random_pose(human(), np.random.default_rng(seed), 0.6)
    for waist in (STIFF, PITCHES):
        trunk = RobotTrunk(human(), waist)
        seen = dict(zip(LIMBS, trunk(pose), strict=True))
        chest = np.stack([seen["chest_ahead"], seen["chest_left"]], axis=1)
        bend = np.column_stack([chest, np.cross(chest[:, 0], chest[:, 1])])
        line = trunk.pelvis @ (waist.below + bend @ waist.above)
        assert line / np.linalg.norm(line) == pytest.approx(line_of(pose), abs=0.01)
        angle = np.arctan2(bend[0, 2], bend[0, 0])
        assert -0.2 - 1e-9 <= angle <= 0.3 + 1e-9
        assert waist is PITCHES or bend == pytest.approx(np.eye(3))


@given(SEEDS)
@settings(max_examples=40, deadline=None)
def test_the_zero_of_a_recorded_root_and_a_turned_world_change_nothing(seed):
    random = np.random.default_rng(seed)
    pose, turn = random_pose(human(), random, 0.6), from_rotation_vector(random.uniform(-2.0, 2.0, 3))
    trunk, other = RobotTrunk(human(), PITCHES), pose.rotation.copy()
    seen, pelvis = trunk(pose), trunk.pelvis
    other[0] = multiply(other[0], from_rotation_vector(np.array([0.0, 0.3, 0.0])))
    assert trunk(Pose(pose.root_position, pose.heading, other)) == pytest.approx(seen, abs=0.01)
    turned = Pose(pose.root_position, pose.heading, multiply(turn, pose.rotation))
    assert trunk(turned) == pytest.approx(seen, abs=1e-9)
    assert trunk.rotation(turned) == pytest.approx(_same(multiply(turn, from_matrix(pelvis)), trunk.rotation(turned)))


def _same(one, other):
    return one if one @ other > 0.0 else -one


def test_the_chest_is_where_the_arms_hang():
    """A bend at the joint from which neck and shoulders hang moves no bone of the spine."""
    raised = {"rsho": (0, -1, 1), "lsho": (0, 1, 1)}
    body = skeleton_of([(name, above, raised.get(name, way), length) for name, above, way, length in HUMAN])
    ahead, turn = LIMBS.index("chest_ahead"), (0.0, 0.7, 0.0)
    straight, bent = (LimbView(body)(pose) for pose in (bent_pose(body), bent_pose(body, rsho=turn, lsho=turn)))
    assert straight[ahead] == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
    joints = body.joints(np.zeros(3), bent_pose(body, rsho=turn, lsho=turn).rotation)
    line = joints[1 + body.index("rsho")] + joints[1 + body.index("lsho")]
    assert np.arctan2(-bent[ahead, 2], bent[ahead, 0]) == pytest.approx(np.arctan2(line[0], line[2]), abs=1e-3)
    assert np.arctan2(line[0], line[2]) > 0.1


def test_thighs_raised_towards_the_trunk_bend_the_waist_by_a_stated_share():
    trunk = RobotTrunk(human(), PITCHES)
    seated = trunk(bent_pose(human(), rkne=(0, -1.5, 0), lkne=(0, -1.5, 0)))
    standing = trunk(bent_pose(human()))
    ahead = LIMBS.index("chest_ahead")
    assert standing[ahead] == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
    assert -np.arctan2(seated[ahead, 2], seated[ahead, 0]) == pytest.approx(0.3, abs=1e-6)  # of 0.4, the waist's range


def test_trunk_and_thighs_share_what_hips_cannot_bend():
    pose = bent_pose(human(), rkne=(0, -1.5, 0), lkne=(0, -0.9, 0))
    trunk = RobotTrunk(human(), replace(STIFF, hips=1.1))
    thigh = trunk(pose)[LIMBS.index("r_thigh")]
    assert np.arctan2(thigh[0], -thigh[2]) == pytest.approx(1.3, abs=1e-6)
    assert np.arctan2(trunk.pelvis[0, 2], trunk.pelvis[2, 2]) == pytest.approx(-0.2, abs=1e-6)
    near = RobotTrunk(human(), replace(STIFF, hips=1.51))
    near(pose)
    assert near.pelvis == pytest.approx(np.eye(3), abs=1e-6)
