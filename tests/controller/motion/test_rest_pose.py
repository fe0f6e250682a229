"""Whatever zero pose a file has, the body is found standing, and every joint stays where the file has it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.motion.rest_pose import LEG_PER_STATURE, RecordedBody, rest_skeleton
from controller.motion.rotations import IDENTITY, about, conjugate, dot, multiply, normalise, rotate, yaw
from controller.motion.up_axis import TO_OURS
from simulated_bodies import human, random_pose, skeleton_of, smooth_poses


def moving(skeleton, seed, frames=30):
    """A body that begins upright and then moves, in our own axes and metres."""
    random = np.random.default_rng(seed)
    rotation = np.array([pose.rotation for pose in smooth_poses(skeleton, random, frames, reach=0.8)])
    rotation[0] = IDENTITY
    vector = skeleton.rest_direction * skeleton.length[:, None]
    return RecordedBody(skeleton.bones, skeleton.parent, vector, random.normal(size=(frames, 3)), rotation)


def in_other_axes(body, up, unit, turn, scramble):
    """The same motion as a file might hold it: its own axes, unit and heading, each bone with axes of its own."""
    to_file = multiply(conjugate(TO_OURS[up]), yaw(turn))
    return RecordedBody(
        body.bones,
        body.parent,
        rotate(conjugate(scramble[1:]), body.vector) / unit,
        rotate(to_file, body.position) / unit,
        multiply(multiply(np.broadcast_to(to_file, body.rotation.shape), body.rotation), scramble),
    )


@pytest.mark.thorough
@settings(max_examples=25)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(["y", "z"]),
    st.sampled_from([1.0, 0.01, 0.001, 0.0254]),
    st.floats(-3.0, 3.0),
    st.booleans(),
)
def test_any_zero_pose_any_axes_any_unit(seed, up, unit, turn, scrambled):
    skeleton = human()
    body = moving(skeleton, seed)
    turns = np.tile(TO_OURS[up], (20, 1))
    if scrambled:
        turns = normalise(np.random.default_rng(seed).normal(size=(20, 4)))
    found, position, rotation, *_ = rest_skeleton("found", in_other_axes(body, up, unit, turn, turns))
    np.testing.assert_allclose(found.length, skeleton.length, rtol=1e-9)
    # Every joint is where it was, but for the heading, which no file tells.
    now, before = found.joints(position, rotation), skeleton.joints(body.position, body.rotation)
    np.testing.assert_allclose(now, rotate(yaw(turn), before), atol=1e-9)
    # And it rests as a person stands: legs down, back up, arms to their own sides.
    direction = dict(zip(found.bones, found.rest_direction, strict=True))
    for leg in ("rkne", "rank", "lkne", "lank"):
        assert direction[leg][2] < -0.75
    assert direction["back"][2] > 0.75
    assert direction["relb"][1] < 0.0 < direction["lelb"][1]


def test_a_zero_pose_that_stands_is_kept_to_the_last_digit():
    skeleton = human()
    body = moving(skeleton, 1)
    found, _, rotation, *_ = rest_skeleton("found", in_other_axes(body, "y", 0.01, 0.0, np.tile(TO_OURS["y"], (20, 1))))
    np.testing.assert_allclose(found.rest_direction, skeleton.rest_direction, atol=1e-12)
    np.testing.assert_allclose(rotation, body.rotation, atol=1e-12)


def test_a_body_that_zeroes_with_y_up_and_moves_with_z_up_is_set_upright():
    body = moving(human(), 2)
    body.position[:, 2] = 0.88
    zero_y = rotate(conjugate(TO_OURS["y"]), body.vector)
    turned = multiply(body.rotation, np.broadcast_to(TO_OURS["y"], body.rotation.shape))
    found, position, rotation, *_ = rest_skeleton(
        "found", RecordedBody(body.bones, body.parent, zero_y, body.position, turned)
    )
    np.testing.assert_allclose(
        found.joints(position, rotation), human().joints(body.position, body.rotation), atol=1e-9
    )


LYING = {
    "on the back": (0.0, -90.0),
    "on the front": (0.0, 90.0),
    "on a side": (90.0, 0.0),
    "on the hands": (180.0, 0.0),
}


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("how", LYING)
def test_a_body_that_never_stands_touches_the_ground_and_rests_standing(how, up):
    """Bones with axes of their own, and a trunk that lies along the axis that would be up in other files."""
    skeleton = human()
    body = moving(skeleton, 3)
    roll, pitch = np.radians(LYING[how])
    over = multiply(about(np.array([0.0, 1.0, 0.0]), pitch), about(np.array([1.0, 0.0, 0.0]), roll))
    rotation = multiply(np.broadcast_to(over, body.rotation.shape), body.rotation)
    lowest = skeleton.joints(np.zeros((30, 3)), rotation)[..., 2].min(axis=1)
    place = np.stack([np.full(30, 1.4), np.full(30, -0.7), 0.02 - lowest], axis=1)
    turns = normalise(np.random.default_rng(5).normal(size=(20, 4)))
    lying = in_other_axes(replace(body, position=place, rotation=rotation), up, 0.01, 0.0, turns)
    found, position, turned, *_ = rest_skeleton("found", lying)
    np.testing.assert_allclose(found.joints(position, turned), skeleton.joints(place, rotation), atol=1e-9)
    # It rests as it would stand, but for feet that slope: no bone is turned about itself by the way up.
    assert np.abs(dot(turned, rotation)).min() > np.cos(0.5 * np.radians(20.0))


@pytest.mark.parametrize("direction", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0)])
def test_what_is_no_human_keeps_its_zero_pose(direction):
    """A chain, or a tail: y is taken to be up, as most files have it."""
    chain = skeleton_of([("a", -1, direction, 1.0), ("b", 0, (0.0, 1.0, 0.0), 0.7)])
    pose = random_pose(chain, np.random.default_rng(0))
    vector = chain.rest_direction * chain.length[:, None]
    found, *_ = rest_skeleton(
        "found", RecordedBody(chain.bones, chain.parent, vector, np.zeros((1, 3)), pose.rotation[None])
    )
    np.testing.assert_allclose(found.rest_direction, rotate(TO_OURS["y"], chain.rest_direction), atol=1e-12)


@pytest.mark.parametrize(
    ("stature", "unit", "other"),
    [(1.2, 0.0254, None), (1.95, 0.0254, 0.01), (2.15, 0.01, 0.0254), (1.0, 0.01, None), (1.7, 0.0254 / 0.45, None)],
)
def test_the_unit_makes_a_person_and_another_that_does_is_named(stature, unit, other):
    written = 0.0254 if stature == 2.15 else unit  # a tall person in inches is a child in cm
    skeleton = human()
    size = stature * LEG_PER_STATURE / float(skeleton.length[[skeleton.index("lkne"), skeleton.index("lank")]].sum())
    body = moving(replace(skeleton, length=size * skeleton.length), 1)
    found = rest_skeleton("found", in_other_axes(body, "y", written, 0.0, np.tile(TO_OURS["y"], (20, 1))))
    assert found.unit == pytest.approx(unit)
    assert found.other_unit == (None if other is None else pytest.approx(other))
