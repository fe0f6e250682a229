import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from controller.motion import rotations as r

numbers = st.floats(-10.0, 10.0, allow_nan=False)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
directions = vectors.filter(lambda v: np.linalg.norm(v) > 1e-3).map(lambda v: v / np.linalg.norm(v))
quaternions = st.tuples(numbers, numbers, numbers, numbers).map(np.array).filter(lambda q: np.linalg.norm(q) > 1e-3)
quaternions = quaternions.map(lambda q: q / np.linalg.norm(q))


def oracle(q):
    return Rotation.from_quat(q, scalar_first=True)


def same_rotation(p, q, within=1e-9):
    return min(np.abs(p - q).max(), np.abs(p + q).max()) < within


@given(quaternions, vectors)
def test_rotate_turns_as_scipy_does(q, v):
    assert np.allclose(r.rotate(q, v), oracle(q).apply(v), atol=1e-12)


@given(quaternions, quaternions)
def test_the_right_factor_of_a_product_turns_first(p, q):
    assert same_rotation(r.multiply(p, q), (oracle(p) * oracle(q)).as_quat(scalar_first=True))


@given(quaternions, vectors)
def test_the_conjugate_turns_back(q, v):
    assert np.allclose(r.rotate(r.conjugate(q), r.rotate(q, v)), v, atol=1e-12)


@given(vectors)
def test_rotation_vectors_become_quaternions_as_in_scipy(v):
    assert same_rotation(r.from_rotation_vector(v), Rotation.from_rotvec(v).as_quat(scalar_first=True))


@given(quaternions)
def test_a_rotation_vector_goes_the_short_way_and_back(q):
    v = r.to_rotation_vector(q)
    assert np.linalg.norm(v) <= np.pi + 1e-12
    assert same_rotation(r.from_rotation_vector(v), q)


@pytest.mark.parametrize("angle", [0.0, 1e-15, 1e-9, 1e-5, np.pi - 1e-9, np.pi])
def test_rotation_vectors_of_tiny_and_half_turns(angle):
    v = angle * np.array([0.6, 0.0, -0.8])
    back = r.to_rotation_vector(r.from_rotation_vector(v))
    assert np.allclose(back, v, rtol=1e-9, atol=0.0)


@given(directions, st.floats(-7.0, 7.0))
def test_about_turns_by_the_angle_about_the_axis(axis, angle):
    assert same_rotation(r.about(axis, angle), Rotation.from_rotvec(axis * angle).as_quat(scalar_first=True))


@given(st.floats(-7.0, 7.0))
def test_yaw_turns_forward_towards_left(angle):
    assert np.allclose(r.rotate(r.yaw(angle), np.array([1.0, 0.0, 0.0])), [np.cos(angle), np.sin(angle), 0.0])


@given(directions, directions)
def test_between_is_the_least_turn_from_one_direction_to_the_other(a, b):
    q = r.between(a, b)
    assert np.allclose(r.rotate(q, a), b, atol=1e-13)
    assert oracle(q).magnitude() == pytest.approx(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b), abs=1e-7)


@given(directions, vectors, st.integers(1, 17))
def test_between_stays_exact_close_to_a_half_turn(a, off, digits):
    b = r.normalise(-a + 10.0**-digits * off)
    assert np.allclose(r.rotate(r.between(a, b), a), b, atol=3e-14)


def test_between_mixes_half_turns_with_others_in_one_array():
    a = np.eye(3)
    b = np.array([[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    assert np.allclose(r.rotate(r.between(a, b), a), b, atol=1e-15)


@given(quaternions)
def test_matrices_of_scipy_lead_back(q):
    assert same_rotation(r.from_matrix(oracle(q).as_matrix()), q)


@given(st.integers(0, 2**32 - 1))
def test_best_fit_aligns_directions_as_scipy_does(seed):
    rng = np.random.default_rng(seed)
    rest, goal = r.normalise(rng.normal(size=(2, 5, 3)))
    expected = Rotation.align_vectors(goal, rest)[0].as_quat(scalar_first=True)
    assert same_rotation(r.best_fit(goal.T @ rest), expected, within=1e-6)


def test_best_fit_of_the_rest_pose_is_the_identity():
    rest = r.normalise(np.random.default_rng(0).normal(size=(4, 3)))
    assert np.allclose(r.best_fit(rest.T @ rest), r.IDENTITY, atol=1e-12)


def test_normalise_leaves_a_zero_vector_alone():
    assert np.array_equal(r.normalise(np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 4.0]])), [[0, 0, 0], [0, 0.6, 0.8]])


def test_continuous_changes_signs_only_and_leaves_no_jump():
    rng = np.random.default_rng(3)
    smooth = r.from_rotation_vector(np.linspace(0.0, 12.0, 200)[:, None, None] * np.array([[0.0, 0.6, 0.8], [1, 0, 0]]))
    flipped = smooth * rng.choice([-1.0, 1.0], size=(200, 2, 1))
    mended = r.continuous(flipped)
    assert np.allclose(np.abs(r.dot(mended, flipped)), 1.0)
    assert np.all(r.dot(mended[1:], mended[:-1]) > 0.99)
    assert mended is not flipped
    assert r.continuous(flipped, own=True) is flipped
    assert np.array_equal(flipped, mended)


def test_functions_broadcast_over_leading_axes():
    rng = np.random.default_rng(4)
    q = r.normalise(rng.normal(size=(7, 1, 4)))
    v = rng.normal(size=(5, 3))
    turned = r.rotate(q, v)
    assert turned.shape == (7, 5, 3)
    assert np.allclose(turned[2, 3], oracle(q[2, 0]).apply(v[3]))


def test_one_rotation_turns_many_as_it_turns_each():
    rng = np.random.default_rng(7)
    p, q = (r.normalise(rng.standard_normal(shape)) for shape in ((4,), (5, 6, 4)))
    each = r.multiply(np.broadcast_to(p, q.shape), q)
    np.testing.assert_allclose(r.multiply(p, q), each, atol=1e-15)
    np.testing.assert_allclose(r.multiply(p, q[0, 0]), each[0, 0], atol=1e-15)


def test_blocks_of_frames_make_what_all_frames_together_make():
    frames = np.random.default_rng(0).standard_normal((5000, 3))
    seen: list[int] = []

    def doubled(values):
        seen.append(len(values))
        return 2.0 * values

    assert np.array_equal(r.by_blocks(doubled, frames), 2.0 * frames)
    assert max(seen) < len(frames) == sum(seen)
