import numpy as np

from controller.rotations import rotate
from sim.retargeting.tucked_pose import tucked_pose
from simulated_bodies import HUMAN, human, skeleton_of


def directions(skeleton):
    pose = tucked_pose(skeleton)
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
