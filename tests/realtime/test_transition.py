import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.mocap.posture import Posture
from controller.realtime.transition import LONGEST, SHORTEST, Briskness, best_anchor, difference, duration
from controller.rotations import from_rotation_vector, multiply, normalise, rotate, to_rotation_vector

BONES = 5


def smooth_posture(seed, t):
    """A made-up body whose bones swing smoothly in time."""
    rng = np.random.default_rng(seed)
    axis, size = rng.standard_normal((BONES, 3)), rng.uniform(0.2, 1.0, (BONES, 1))
    offset, phase = rng.standard_normal((BONES, 3)), rng.uniform(0, 6, (BONES, 1))
    turn = multiply(from_rotation_vector(offset), from_rotation_vector(size * np.sin(3 * t + phase) * normalise(axis)))
    drift = rng.standard_normal(4) + 0.1 * np.sin(2 * t + rng.uniform(0, 6, 4))
    return Posture(np.array(drift[0]), drift[1:3], np.array(drift[3]), turn)


def tips(posture):
    """Where the ends of bones of 30 cm are that all hang from the root."""
    up = np.array([0.0, 0.0, float(posture.height)])
    return rotate(posture.rotation, np.array([0.3, 0.0, 0.0])) + up


def angle_between(a, b):
    return np.linalg.norm(to_rotation_vector(multiply(a.rotation, b.rotation * [1, -1, -1, -1])), axis=-1).max()


def fade_of(seed, bound, dt=0.005):
    shown = smooth_posture(seed, -dt), smooth_posture(seed, 0.0)
    target = smooth_posture(seed + 1, 1.0 - dt), smooth_posture(seed + 1, 1.0)
    return difference(shown, target, dt, tips, Briskness(bound, np.ones(BONES))), shown, seed + 1


@given(st.integers(0, 200), st.floats(5.0, 500.0))
def test_it_starts_where_the_body_is_and_ends_on_the_target(seed, bound):
    fade, shown, other = fade_of(seed, bound)
    start = fade.apply(smooth_posture(other, 1.0), 0.0)
    assert angle_between(start, shown[1]) < 1e-6
    assert start.height == pytest.approx(shown[1].height)
    end = smooth_posture(other, 1.0 + fade.duration)
    assert angle_between(fade.apply(end, fade.duration), end) < 1e-9


@given(st.integers(0, 200))
def test_velocity_is_continuous_at_the_switch(seed):
    dt = 1e-4
    fade, shown, other = fade_of(seed, 50.0, dt)
    after = fade.apply(smooth_posture(other, 1.0 + dt), dt)
    before_step = to_rotation_vector(multiply(shown[1].rotation, shown[0].rotation * [1, -1, -1, -1])) / dt
    after_step = to_rotation_vector(multiply(after.rotation, shown[1].rotation * [1, -1, -1, -1])) / dt
    assert np.abs(after_step - before_step).max() < 0.15


@given(st.floats(0.0, 2.0), st.floats(0.0, 8.0), st.floats(0.0, 3.0), st.floats(1.0, 500.0))
def test_the_duration_keeps_the_fade_within_its_bound(apart, parting, drift, bound):
    far, rate = np.array([[apart, 0, 0]]), np.array([[0, parting, 0]])
    length = duration(far, rate, np.zeros(1), drift, Briskness(bound, np.zeros(1)))
    assert SHORTEST <= length <= LONGEST
    if length < LONGEST:
        s = np.linspace(0, 1, 400)[:, None]
        value = -60 * s + 180 * s**2 - 120 * s**3
        rise = -36 * s + 96 * s**2 - 60 * s**3
        acceleration = np.linalg.norm((value * far + length * rise * rate) / length**2, axis=1)
        walk = 30.0 * (s[:, 0] * (1 - s[:, 0])) ** 2 * drift / length
        assert (acceleration + walk).max() <= bound * 1.001


@given(st.floats(0.01, 2.0), st.floats(0.0, 3.0), st.floats(0.0, 4.0))
def test_bones_that_turn_far_or_fast_take_longer(apart, angle, speed):
    far, still = np.array([[apart, 0.0, 0.0]]), np.zeros((1, 3))
    plain = duration(far, still, np.zeros(1), 0.0, Briskness(20.0, np.zeros(1)))
    assert duration(far, still, np.array([angle]), 0.0, Briskness(20.0, np.array([speed]))) >= plain


def test_a_larger_bound_makes_a_shorter_fade():
    far, still = np.array([[1.0, 0, 0]]), np.zeros((1, 3))
    lengths = [duration(far, still, np.ones(1), 0.0, Briskness(b, np.ones(1))) for b in (5.0, 20.0, 80.0)]
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[0] > lengths[2]


def test_a_difference_near_half_a_turn_does_not_spin_round():
    dt = 0.005
    half = [from_rotation_vector(np.array([[np.pi + e, 0.0, 0.0]])) for e in (-0.01, 0.01)]
    still = np.array([[1.0, 0.0, 0.0, 0.0]])
    zero = np.zeros(2)
    shown = tuple(Posture(np.array(1.0), zero, np.array(0.0), h) for h in half)
    target = Posture(np.array(1.0), zero, np.array(0.0), still)
    fade = difference(shown, (target, target), dt, tips, Briskness(50.0, np.ones(1)))
    assert np.linalg.norm(fade.turn_rate) == pytest.approx(0.02 / dt, rel=0.01)


def test_the_anchor_that_moves_the_same_way_is_chosen():
    places = np.array([[0.0], [0.0], [1.0]])
    velocities = np.array([[-1.0], [1.0], [1.0]])
    assert best_anchor(np.array([0.05]), np.array([0.9]), places, velocities, reach=0.1) == 1
