import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from controller.motion.encodings.normalisation import Normalisation
from motiondeck_base.errors import MotiondeckError

values = st.floats(-1e6, 1e6, allow_subnormal=True)
patterns = st.integers(1, 5).flatmap(
    lambda channels: st.lists(
        st.integers(1, 6).flatmap(lambda frames: hnp.arrays(np.float64, (frames, channels), elements=values)),
        min_size=1,
        max_size=4,
    )
)


@given(patterns)
def test_all_patterns_together_fill_the_range_from_minus_one_to_one(frames):
    normalisation = Normalisation.fit(frames)
    scaled = np.concatenate([normalisation.apply(pattern) for pattern in frames])
    varies = normalisation.scaling > 0.0
    assert np.allclose(scaled[:, varies].min(axis=0), -1.0)
    assert np.allclose(scaled[:, varies].max(axis=0), 1.0)
    assert np.array_equal(scaled[:, ~varies], np.zeros_like(scaled[:, ~varies]))


@given(patterns)
def test_there_and_back_is_the_same_to_the_resolution_of_float32(frames):
    normalisation = Normalisation.fit(frames)
    size = np.abs(np.concatenate(frames)).max(axis=0)
    for pattern in frames:
        back = normalisation.invert(normalisation.apply(pattern))
        varies = normalisation.scaling > 0.0
        assert np.all(np.abs(back - pattern) <= np.where(varies, 1e-15, 2e-7) * size + 1e-37)


@given(patterns)
def test_it_can_be_stored_as_float32(frames):
    stored = Normalisation.fit(frames)
    stored = Normalisation(stored.shift.astype(np.float32), stored.scaling.astype(np.float32))
    for pattern in frames:
        back = stored.invert(stored.apply(pattern.astype(np.float32)))
        assert back.dtype == np.float32
        size = np.maximum(np.abs(np.concatenate(frames)).max(axis=0), 1e-30)  # below that float32 runs out
        assert np.all(np.abs(back - pattern) <= 1e-6 * size)


def test_the_equations_of_the_thesis():
    normalisation = Normalisation.fit([np.array([[1.0], [3.0]]), np.array([[2.0], [7.0]])])
    assert normalisation.shift.tolist() == [-4.0]
    assert normalisation.scaling.tolist() == [2.0 / 6.0]
    assert normalisation.apply(np.array([4.0])).tolist() == [0.0]


def test_a_constant_channel_becomes_zero_and_comes_back_whatever_is_played():
    normalisation = Normalisation.fit([np.array([[5.0, 0.0], [5.0, 1.0]])])
    assert normalisation.apply(np.array([5.0, 1.0])).tolist() == [0.0, 1.0]
    assert normalisation.invert(np.array([0.3, 1.0])).tolist() == [5.0, 1.0]


def test_rounding_noise_around_a_constant_is_not_blown_up():
    noise = 1.0 + 1e-15 * np.random.default_rng(0).normal(size=(50, 1))
    assert np.array_equal(Normalisation.fit([noise]).apply(noise), np.zeros((50, 1)))


def test_what_hardly_varies_is_scaled_as_if_it_varied_by_a_least_range():
    normalisation = Normalisation.fit([np.array([[5.0, 0.0, 0.0], [5.0, 0.1, 8.0]])], least_range=2.0)
    assert normalisation.scaling.tolist() == [1.0, 1.0, 0.25]
    seen = np.array([[5.5, -0.4, 6.0]])
    assert np.allclose(normalisation.invert(normalisation.apply(seen)), seen)


def test_values_beyond_the_fitted_range_go_beyond_one_and_back():
    normalisation = Normalisation.fit([np.array([[0.0], [2.0]])])
    assert normalisation.apply(np.array([4.0])).tolist() == [3.0]
    assert normalisation.invert(np.array([3.0])).tolist() == [4.0]


@pytest.mark.parametrize(
    ("frames", "complaint"),
    [
        ([], "expected frames x channels"),
        ([np.zeros(4)], "expected frames x channels"),
        ([np.zeros((0, 4))], "expected frames x channels"),
        ([np.zeros((3, 4)), np.zeros((3, 5))], "channels, the same"),
        ([np.array([[0.0, np.nan]])], "channel 1 holds a number that is not finite"),
        ([np.array([[np.inf, 0.0]])], "channel 0 holds a number that is not finite"),
        ([np.array([[-1e308], [1e308]])], "channel 0 holds a number that is not finite or far too large"),
    ],
)
def test_patterns_that_cannot_be_normalised_are_refused(frames, complaint):
    with pytest.raises(MotiondeckError, match=complaint):
        Normalisation.fit(frames)


@pytest.mark.parametrize(
    ("shift", "scaling", "complaint"),
    [
        (np.zeros(3), np.zeros(2), "shape"),
        (np.zeros((2, 1)), np.zeros((2, 1)), "shape"),
        (np.array([np.nan]), np.ones(1), "not finite"),
        (np.zeros(1), np.array([np.inf]), "not finite"),
        (np.zeros(1), np.array([-1.0]), "negative"),
    ],
)
def test_a_normalisation_that_cannot_be_is_refused(shift, scaling, complaint):
    with pytest.raises(MotiondeckError, match=complaint):
        Normalisation(shift, scaling)
