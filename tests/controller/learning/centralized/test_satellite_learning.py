"""Learned satellites: the greedy choice is the greedy choice, the gradient is the gradient, and learning helps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.learning.centralized.satellite_learning import (
    WIDTHS,
    LearnedSatellites,
    _Projection,
    choose_satellites,
    learn,
    learn_jointly,
    ridge_readout,
    slow_and_fast,
)
from controller.networks.centralized.centers import pairs_at
from controller.networks.centralized.satellites import GaussianSatellites
from motiondeck_base.errors import MotiondeckError

TIME = np.arange(240) / 120.0
FREQUENCY = np.array([np.pi, 9.0])


def wiggle(seed, columns=4):
    """Smooth curves that nothing here can tell exactly."""
    rng = np.random.default_rng(seed)
    rates, phases = rng.uniform(1, 20, (columns, 6)), rng.uniform(0, 6, (columns, 6))
    return np.sin(TIME[:, None, None] * rates + phases).sum(-1)


def error_with(satellites, states, target):
    response = satellites.respond(states)
    left = target - response @ np.linalg.lstsq(response, target, rcond=1e-12)[0]
    return np.square(left).sum() / np.square(target).sum()


def test_the_first_choices_are_those_that_explain_most():
    states, target = pairs_at(FREQUENCY, np.zeros(2), TIME), wiggle(0)
    candidates = [(place, b) for place in states[::2] for b in WIDTHS]
    taken = []
    for _ in range(2):
        errors = [
            error_with(
                GaussianSatellites(np.array([p for p, _ in [*taken, c]]), np.array([b for _, b in [*taken, c]])),
                states,
                target,
            )
            for c in candidates
        ]
        taken.append(candidates[int(np.argmin(errors))])
    chosen, _ = choose_satellites(states, target, 2)
    assert np.allclose(chosen.places, [place for place, _ in taken])
    assert np.allclose(chosen.sharpness, [b for _, b in taken])


@given(st.integers(1, 40), st.integers(0, 5))
def test_the_error_it_reports_is_what_the_best_weights_leave(count, seed):
    states, target = pairs_at(FREQUENCY, np.zeros(2), TIME), wiggle(seed)
    chosen, error = choose_satellites(states, target, count)
    assert len(chosen) == count
    assert error == pytest.approx(error_with(chosen, states, target), rel=0.05, abs=1e-7)


@settings(max_examples=8)
@given(st.integers(0, 20), st.booleans())
def test_the_gradient_is_that_of_the_loss(seed, move):
    rng = np.random.default_rng(seed)
    satellites = GaussianSatellites(rng.normal(size=(7, 4)), rng.uniform(0.5, 2.0, 7))
    problem = _Projection(
        LearnedSatellites(FREQUENCY, np.array([0.2, -0.4]), satellites, 1.0), wiggle(seed), TIME, move, ridge_readout
    )
    x = problem.pack(LearnedSatellites(FREQUENCY, np.array([0.2, -0.4]), satellites, 1.0))
    _, gradient = problem.loss(x)
    for i in range(len(x)):
        step = np.zeros(len(x))
        step[i] = 1e-5
        slope = (problem.loss(x + step)[0] - problem.loss(x - step)[0]) / 2e-5
        assert gradient[i] == pytest.approx(slope, rel=1e-4, abs=1e-6)


def test_moving_satellites_and_frequencies_helps():
    target = wiggle(3)
    states = pairs_at(FREQUENCY, np.zeros(2), TIME)
    satellites, error = choose_satellites(states, target, 12)
    start = LearnedSatellites(FREQUENCY, np.zeros(2), satellites, error)
    placed = learn_jointly(start, target, TIME, 60, move_frequencies=False)
    moved = learn_jointly(placed, target, TIME, 60)
    assert placed.error < 0.7 * error
    assert moved.error < placed.error
    assert np.array_equal(placed.frequency, FREQUENCY)
    assert not np.allclose(moved.frequency, FREQUENCY)


def test_the_whole_recipe_learns_what_a_network_made():
    rng = np.random.default_rng(0)
    states = pairs_at(FREQUENCY, np.zeros(2), TIME)
    maker = GaussianSatellites(states[rng.integers(0, 240, 8)], rng.uniform(0.8, 2.0, 8))
    target = maker.respond(states) @ rng.normal(size=(8, 5))
    starts = [FREQUENCY * factor for factor in (0.7, 1.0, 1.4)]
    learned = learn(target, TIME, 16, starts, iterations=100)
    assert learned.error < 1e-5
    told = learned.respond(TIME) @ ridge_readout(learned.respond(TIME), target).T
    assert np.square(told - target).sum() / np.square(target).sum() < 2e-5


@given(st.integers(1, 4), st.integers(1, 20))
def test_starts_have_a_slow_center_first(centers, tries):
    for frequency in slow_and_fast(2.0, centers, tries, seed=1):
        assert frequency.shape == (centers,)
        assert frequency[0] <= 2 * np.pi / 2.0 + 1e-9
        assert (np.diff(frequency) >= 0).all()


def test_too_many_satellites_and_impossible_frequencies_are_refused():
    target = wiggle(0)
    with pytest.raises(MotiondeckError, match="240 satellites"):
        learn(target, TIME, 240, [FREQUENCY])
    with pytest.raises(MotiondeckError, match="300 satellites"):
        choose_satellites(pairs_at(FREQUENCY, np.zeros(2), TIME), target, 300)
    with pytest.raises(MotiondeckError, match="center 1"):
        learn(target, TIME, 10, [np.array([1.0, np.nan])])


def test_what_does_not_move_is_learned_at_once():
    learned = learn(np.zeros((240, 3)), TIME, 6, [FREQUENCY])
    assert learned.error == 0.0
    assert len(learned.satellites) == 6
    assert not ridge_readout(learned.respond(TIME), np.zeros((240, 3))).any()
