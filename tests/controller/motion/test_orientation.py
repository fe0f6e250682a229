import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bodies import random_body, small_body
from controller.motion.orientation import orient
from controller.motion.rotations import (
    IDENTITY,
    about,
    between,
    conjugate,
    dot,
    from_rotation_vector,
    multiply,
    normalise,
    rotate,
    to_rotation_vector,
)
from controller.motion.skeleton import ROOT

seeds = st.integers(0, 2**32 - 1)


def angle(p, q):
    """Rotation angles between quaternions (..., 4)."""
    return np.linalg.norm(to_rotation_vector(multiply(conjugate(p), q)), axis=-1)


@given(seeds, st.integers(1, 25))
def test_every_bone_points_where_it_should(seed, bones):
    rng = np.random.default_rng(seed)
    body = random_body(rng, bones)
    direction = normalise(rng.normal(size=(6, bones, 3)))
    rotation = orient(body, direction)
    assert np.allclose(rotate(rotation[:, 1:], body.rest_direction), direction, rtol=0.0, atol=1e-12)
    assert np.allclose(np.linalg.norm(rotation, axis=-1), 1.0, rtol=0.0, atol=1e-12)


@given(seeds, st.integers(1, 25))
def test_one_frame_alone_is_turned_as_among_many(seed, bones):
    rng = np.random.default_rng(seed)
    body = random_body(rng, bones)
    direction = normalise(rng.normal(size=(2, 3, bones, 3)))
    together = orient(body, direction)
    assert together.shape == (2, 3, 1 + bones, 4)
    assert together.flags.c_contiguous
    alone = orient(body, direction[1, 2])
    assert alone.shape == (1 + bones, 4)
    assert np.all(angle(alone, together[1, 2]) < 1e-7)


def test_the_rest_pose_needs_no_rotation():
    body = small_body()
    assert np.allclose(orient(body, body.rest_direction), IDENTITY, atol=1e-12)


@given(seeds)
def test_a_body_turned_as_a_whole_is_turned_as_a_whole(seed):
    rng = np.random.default_rng(seed)
    body = small_body()
    turn = from_rotation_vector(rng.normal(size=3))
    rotation = orient(body, rotate(turn, body.rest_direction))
    assert np.all(angle(rotation, turn) < 1e-7)


def test_a_bone_with_one_child_swings_without_twisting():
    body = small_body()
    direction = body.rest_direction.copy()
    leg = body.index("rleg")
    direction[leg] = normalise(np.array([1.0, 0.2, -0.5]))
    rotation = orient(body, direction)
    carried = rotation[body.parent[leg] + 1]
    swing = to_rotation_vector(multiply(rotation[leg + 1], conjugate(carried)))
    assert abs(swing @ direction[leg]) < 1e-12
    assert abs(swing @ rotate(carried, body.rest_direction[leg])) < 1e-12


def test_a_chest_is_twisted_so_that_the_arms_fit():
    body = small_body()
    chest, arms = body.index("chest"), [body.index("rarm"), body.index("larm")]
    twist = about(np.array([0.0, 0.0, 1.0]), 0.7)
    direction = body.rest_direction.copy()
    direction[arms] = rotate(twist, direction[arms])
    rotation = orient(body, direction)
    assert angle(rotation[chest + 1], twist) < 1e-12
    assert np.all(angle(rotation[[arm + 1 for arm in arms]], twist) < 1e-12)
    assert angle(rotation[0], IDENTITY) < 1e-12


@given(seeds)
def test_no_other_twist_of_a_bone_fits_its_children_better(seed):
    rng = np.random.default_rng(seed)
    body = random_body(rng, 12)
    direction = normalise(rng.normal(size=(12, 3)))
    rotation = orient(body, direction)
    for bone in range(12):
        children = body.children(bone)
        if len(children) > 1:

            def fit(twist, bone=bone, children=children):
                turned = multiply(about(direction[bone], twist), rotation[bone + 1])
                return dot(rotate(turned, body.rest_direction[children]), direction[children]).sum()

            assert fit(0.0) >= max(fit(twist) for twist in np.linspace(0.1, 6.2, 40)) - 1e-9


@given(seeds)
def test_no_other_turn_of_the_root_fits_its_bones_better(seed):
    rng = np.random.default_rng(seed)
    body = random_body(rng, 12)
    direction = normalise(rng.normal(size=(12, 3)))
    root, first = orient(body, direction)[0], body.children(ROOT)

    def fit(q):
        return dot(rotate(q, body.rest_direction[first]), direction[first]).sum()

    others = multiply(from_rotation_vector(rng.normal(size=(50, 1, 3))), root)
    assert fit(root) >= max(fit(other) for other in others) - 1e-9


def test_half_turns_are_turned_one_way_or_the_other():
    body = small_body()
    direction = body.rest_direction.copy()
    for bone in ("rleg", "head", "larm"):
        direction[body.index(bone)] *= -1.0
    for rotation in (orient(body, direction), orient(body, np.stack([body.rest_direction, direction]))[1]):
        assert np.allclose(rotate(rotation[1:], body.rest_direction), direction, atol=1e-12)


def test_children_along_their_parent_leave_the_twist_alone():
    body = small_body()
    direction = body.rest_direction.copy()
    chest = body.index("chest")
    direction[body.children(chest)] = direction[chest]
    rotation = orient(body, direction)
    assert np.allclose(rotate(rotation[1:], body.rest_direction), direction, atol=1e-12)


def test_a_direction_that_is_missing_leaves_its_bone_where_the_parent_carries_it():
    body = small_body()
    direction = body.rest_direction.copy()
    direction[body.index("head")] = 0.0
    assert np.allclose(orient(body, direction), IDENTITY, atol=1e-12)


def test_small_steps_of_the_directions_make_small_steps_of_the_rotations():
    rng = np.random.default_rng(5)
    body = small_body()
    time = np.linspace(0.0, 2.0 * np.pi, 2000)[:, None]
    swings = from_rotation_vector(
        sum(np.sin(k * time + rng.uniform(0.0, 6.0, 9))[..., None] * rng.normal(size=(9, 3)) * 0.3 for k in (1, 2))
    )
    rotation = orient(body, rotate(swings, body.rest_direction))
    assert angle(rotation[1:], rotation[:-1]).max() < 0.02


@pytest.mark.parametrize("frames", [0, 1])
def test_no_frame_and_a_single_frame_keep_their_shapes(frames):
    body = small_body()
    assert orient(body, np.tile(body.rest_direction, (frames, 1, 1))).shape == (frames, 10, 4)


def test_a_swing_is_the_one_that_rotations_define():
    body = random_body(np.random.default_rng(8), 1)
    direction = normalise(np.random.default_rng(9).normal(size=(5, 1, 3)))
    rotation = orient(body, direction)
    carried = rotate(rotation[:, 0], body.rest_direction[0])
    expected = multiply(between(carried, direction[:, 0]), rotation[:, 0])
    assert np.all(angle(rotation[:, 1], expected) < 1e-7)
