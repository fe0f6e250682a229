from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bodies import random_body, small_body
from controller.motion.rotations import IDENTITY, from_rotation_vector, multiply, normalise, rotate
from controller.motion.skeleton import ROOT, Skeleton
from motiondeck_base.errors import FileFormatError


def test_in_the_rest_pose_bones_point_where_the_skeleton_says():
    body = small_body()
    joints = body.joints(np.array([0.0, 0.0, 1.0]), np.tile(IDENTITY, (10, 1)))
    assert np.allclose(joints[0], [0.0, 0.0, 1.0])
    assert np.allclose(joints[body.index("rfoo") + 1], [0.2, -0.1, 0.2])
    assert np.allclose(joints[body.index("head") + 1], [0.0, 0.0, 1.7])


@given(st.integers(0, 2**32 - 1), st.integers(1, 25))
def test_forward_kinematics_follows_the_tree_bone_by_bone(seed, bones):
    rng = np.random.default_rng(seed)
    body = random_body(rng, bones)
    rotation = normalise(rng.normal(size=(4, 1 + bones, 4)))
    root = rng.normal(size=(4, 3))
    joints = body.joints(root, rotation)
    for bone, parent in enumerate(body.parent):
        start = root if parent == ROOT else joints[:, parent + 1]
        end = start + body.length[bone] * rotate(rotation[:, bone + 1], body.rest_direction[bone])
        assert np.allclose(joints[:, bone + 1], end, atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.integers(1, 25))
def test_one_body_alone_is_placed_as_among_many(seed, bones):
    rng = np.random.default_rng(seed)
    body = random_body(rng, bones)
    places, rotation = rng.normal(size=(3, 3)), normalise(rng.normal(size=(3, 1 + bones, 4)))
    together = body.joints(places, rotation)
    assert np.allclose(body.joints(places[1], rotation[1]), together[1], rtol=0.0, atol=1e-12)


def test_turning_the_whole_body_turns_all_joints():
    rng = np.random.default_rng(1)
    body = small_body()
    rotation = normalise(rng.normal(size=(10, 4)))
    turn = from_rotation_vector(np.array([0.3, -2.0, 0.7]))
    before = body.joints(np.zeros(3), rotation)
    assert np.allclose(body.joints(np.zeros(3), multiply(turn, rotation)), rotate(turn, before))


def test_children_and_walk_describe_the_same_tree():
    body = random_body(np.random.default_rng(2), 20)
    for bone, (parent, rest, children) in enumerate(body.walk):
        assert parent == body.parent[bone]
        assert rest == body.rest_direction[bone].tolist()
        assert children == body.children(bone).tolist()


def test_leg_length_is_the_depth_of_the_rest_pose_below_the_root():
    assert small_body().leg_length == pytest.approx(0.8)


def test_a_bone_is_found_by_name():
    assert small_body().index("lleg") == 4
    with pytest.raises(KeyError, match="tail"):
        small_body().index("tail")


def test_skeletons_can_be_compared_and_kept_in_sets():
    one, other = small_body(), small_body()
    assert one == one
    assert one != other
    assert len({one, other}) == 2


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"bones": ()}, "no bones"),
        ({"length": np.ones(3)}, "9 bones"),
        ({"rest_direction": np.full((9, 3), np.nan)}, "not finite"),
        ({"length": np.full(9, np.inf)}, "not finite"),
        ({"rest_direction": np.full((9, 3), 0.5)}, "no unit vector"),
        ({"length": np.full(9, -1.0)}, "a length is below 0"),
        ({"parent": np.array([-1, 2, 0, -1, 3, -1, 5, 5, 5])}, "'rleg' does not follow its parent"),
        ({"parent": np.array([0, 0, 1, -1, 3, -1, 5, 5, 5])}, "'rhip' does not follow its parent"),
        ({"parent": np.array([-2, 0, 1, -1, 3, -1, 5, 5, 5])}, "'rhip' does not follow its parent"),
        ({"bones": ("a", "b", "c", "d", "e", "f", "g", "h", "a")}, "two bones are called 'a'"),
    ],
)
def test_a_skeleton_that_cannot_be_is_refused(change, complaint):
    with pytest.raises(FileFormatError, match=complaint) as error:
        replace(small_body(), **change)
    assert "'small'" in str(error.value)


def test_a_single_bone_is_a_skeleton():
    body = Skeleton("stick", ("stick",), np.array([ROOT]), np.array([[0.0, 0.0, -1.0]]), np.array([1.0]))
    assert body.leg_length == 1.0
