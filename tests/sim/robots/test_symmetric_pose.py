import numpy as np
import pytest

from controller.motion.rotations import rotate
from sim.robots.robot import TUCKED, Bends, symmetric_pose
from simulated_bodies import HUMAN, human, skeleton_of


def directions(skeleton, bends=TUCKED):
    pose = symmetric_pose(skeleton, bends)
    turned = rotate(pose.rotation[1:], skeleton.rest_direction)
    return dict(zip(skeleton.bones, turned, strict=True))


def test_the_hips_are_bent_as_on_a_chair_and_the_forearms_are_before_the_face():
    points = directions(human())
    for side in "rl":
        assert points[f"{side}kne"][0] > 0.9
        assert points[f"{side}ank"][2] < -0.8
        assert points[f"{side}elb"][0] > 0.5
        assert points[f"{side}wri"][2] > 0.9
        assert abs(points[f"{side}foo"] @ points[f"{side}ank"]) < 1e-9
    assert np.allclose(points["neck"], (0.0, 0.0, 1.0))


def test_it_is_the_same_whatever_the_rest_pose():
    hanging = [(name, parent, (0, 0, -1) if name[1:] in ("elb", "wri", "han") else way, length)
               for name, parent, way, length in HUMAN]  # fmt: skip
    there, here = directions(skeleton_of(hanging)), directions(human())
    assert all(np.allclose(there[bone], here[bone]) for bone in here)


def test_each_joint_bends_by_its_own_angle():
    straight = directions(human(), Bends(0.0, 0.0, 0.0, 0.0, 0.0))
    assert np.allclose([straight["rkne"], straight["rank"], straight["lelb"], straight["lwri"]], (0.0, 0.0, -1.0))
    assert np.allclose(straight["lfoo"], (1.0, 0.0, 0.0))
    bends = Bends(hip=0.5, knee=0.8, ankle=0.3, shoulder=-0.4, elbow=0.6)
    points = directions(human(), bends)

    def angle(a, b):
        return np.arccos(points[a] @ points[b])

    assert np.arccos(points["rkne"] @ (0.0, 0.0, -1.0)) == pytest.approx(0.5)
    assert points["relb"][0] < 0.0 < points["rkne"][0]
    assert angle("rkne", "rank") == pytest.approx(0.8)
    assert angle("rank", "rfoo") == pytest.approx(np.pi / 2 + 0.3)
    assert angle("relb", "rwri") == pytest.approx(0.6)
