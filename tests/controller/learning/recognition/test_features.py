from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.recognition.reduction import by_conditional_entropy, by_principal_axes, by_variance
from controller.learning.recognition.features import (
    CANONICAL,
    JOINTS,
    FeatureRecipe,
    features,
    resampled,
    with_velocity,
)
from controller.motion.canonical.canonical_body import to_canonical
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import multiply, rotate, yaw
from motiondeck_base.errors import MotiondeckError
from recognition_examples import clip


def turned_and_moved(original, angle, place):
    turn = yaw(angle)
    return replace(
        original,
        root_position=rotate(turn, original.root_position) + place,
        rotation=multiply(turn, original.rotation),
    )


@given(st.floats(-3.0, 3.0), st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
def test_where_somebody_stands_and_faces_does_not_matter(angle, x, y):
    original = clip("march")
    recipe = FeatureRecipe(height=True)
    moved = turned_and_moved(original, angle, np.array([x, y, 0.0]))
    assert np.allclose(features(moved, recipe), features(original, recipe), atol=1e-9)


def test_without_heading_it_does():
    recipe = FeatureRecipe(heading=False, velocity=False)
    moved = turned_and_moved(clip("march"), 1.0, np.zeros(3))
    assert not np.allclose(features(moved, recipe), features(clip("march"), recipe), atol=0.1)


def test_rotations_of_bones_are_seen_against_their_parents():
    recipe = FeatureRecipe(kind="rotations", velocity=False)
    moved = turned_and_moved(clip("wave"), 1.0, np.zeros(3))
    assert np.allclose(features(moved, recipe), features(clip("wave"), recipe), atol=1e-9)


@pytest.mark.parametrize(("recipe", "channels"), [
    (FeatureRecipe(), 48),
    (FeatureRecipe(velocity=False), 24),
    (FeatureRecipe(joints=("rarm", "larm"), velocity=False, height=True), 7),
])  # fmt: skip
def test_the_recipe_says_how_many_channels_there_are(recipe, channels):
    assert features(clip("bow"), recipe).shape[1] == channels


def test_a_joint_that_the_skeleton_lacks_is_named():
    with pytest.raises(MotiondeckError, match=r"ann-bow\.amc: skeleton 'ann' has no bone tail"):
        features(clip("bow"), FeatureRecipe(joints=("rarm", "tail")))


def test_an_impossible_rate_is_refused():
    with pytest.raises(MotiondeckError, match="0 Hz"):
        FeatureRecipe(rate=0.0)


@given(st.integers(1, 200), st.floats(5.0, 200.0), st.floats(5.0, 200.0))
def test_resampling_keeps_a_straight_line_and_its_length_in_time(count, rate, wanted):
    line = np.arange(count, dtype=float)[:, None] / rate
    out = resampled(line, rate, wanted)
    assert np.allclose(out[:, 0], np.arange(len(out)) / wanted)
    assert (count - 1) / rate - 1.0 / wanted - 1e-6 <= out[-1, 0] <= (count - 1) / rate + 1e-6


def test_a_slower_motion_has_more_frames_of_the_same_postures():
    recipe = FeatureRecipe(velocity=False)
    plain, slow = features(clip("wave"), recipe), features(clip("wave"), recipe, stretch=2.0)
    assert np.allclose(slow[::2][: len(plain)], plain[: len(slow[::2])], atol=1e-9)


def test_velocity_is_zero_where_nothing_moves_and_of_a_single_frame():
    assert np.array_equal(with_velocity(np.ones((5, 2)), 30.0)[:, 2:], np.zeros((5, 2)))
    assert with_velocity(np.ones((1, 2)), 30.0).shape == (1, 4)


def test_conditional_entropy_drops_what_others_tell():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(500, 1)), rng.normal(size=(500, 1))
    frames = np.column_stack([a, b, a + 0.5 * b + 1e-4 * rng.normal(size=(500, 1))])
    kept = by_conditional_entropy(frames, 2)
    assert np.linalg.matrix_rank(frames @ kept) == 2
    assert np.cov((frames @ kept).T).shape == (2, 2)
    alone = np.column_stack([a, a, b])
    assert by_conditional_entropy(alone, 2)[2].sum() == 1.0


def test_variance_keeps_what_varies_and_principal_axes_are_orthonormal():
    frames = np.random.default_rng(0).normal(size=(300, 4)) * np.array([1.0, 5.0, 0.1, 3.0])
    assert np.array_equal(by_variance(frames, 2), np.eye(4)[:, [1, 3]])
    axes = by_principal_axes(frames, 3)
    assert np.allclose(axes.T @ axes, np.eye(3))
    assert (frames @ axes).var(0)[0] > 20.0


@pytest.fixture(scope="module")
def recorded(mocap_data):
    """A BVH and markers."""
    return [read_clip(mocap_data / file) for file in ("bvh/bandai/walk_normal_001.bvh", "c3d/0803_walk.c3d")]


@pytest.mark.thorough
def test_a_recognizer_of_acclaim_joints_reads_other_bodies_by_the_canonical_ones(recorded):
    """Trained on CMU's names, it looks at the same joints of a BVH and of markers."""
    recipe = FeatureRecipe(joints=JOINTS)
    for one in recorded:
        by_name = features(to_canonical(one), FeatureRecipe(joints=tuple(CANONICAL[joint] for joint in JOINTS)))
        assert np.array_equal(features(one, recipe), by_name)


@pytest.mark.thorough
def test_recordings_of_several_kinds_share_the_canonical_joints(recorded):
    one, other = recorded
    assert FeatureRecipe().for_clips([one, one]).joints == one.skeleton.bones
    assert set(FeatureRecipe().for_clips([one, other]).joints) <= set(to_canonical(one).skeleton.bones)
