from itertools import product
from math import ceil, copysign

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.loop.safety.braking import braked, held_back, longest_run, stopping_run

rates = st.floats(-4.0, 0.0).map(lambda exponent: 10.0**exponent)


def released(h, j):
    """G(h): the velocity gained while the acceleration h, counting itself, is let go by j a tick."""
    n = ceil(abs(h) / j)
    return copysign(n * abs(h) - 0.5 * j * n * (n - 1), h)


@given(st.floats(-10.0, 10.0), rates)
def test_holding_back_undoes_releasing(h, j):
    assert np.isclose(held_back(released(h, j), j), h, rtol=1e-9, atol=j * 1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_acceleration_held_back_adds_up_to_the_velocity(sign):
    assert np.isclose(held_back(sign * (0.7 + 0.5 + 0.3 + 0.1), 0.2), sign * 0.7)


@st.composite
def states(draw):
    """(v, a, most, j) of a joint that stops within a few hundred ticks."""
    j = draw(rates)
    most = j * draw(st.floats(0.2, 60.0))
    a = most * draw(st.one_of(st.sampled_from([-1.0, 0.0, 1.0]), st.floats(-1.0, 1.0)))
    v = most * draw(st.one_of(st.just(0.0), st.floats(-100.0, 100.0)))
    return v, a, most, j


def walk_to_rest(v, a, most, j):
    """The positions and accelerations on the way to rest, one tick after the other."""
    position, positions, accelerations = 0.0, [0.0], [float(a)]
    while abs(v) > 1e-12 * most or abs(a) > 1e-12 * most:
        a = braked(v, a, most, j)
        v = v + a
        position += v
        positions.append(float(position))
        accelerations.append(float(a))
        assert len(positions) < 2000, "it never comes to rest"
    return np.array(positions), np.array(accelerations)


@given(states())
def test_the_closed_sums_are_those_of_the_walk_itself(state):
    positions, _ = walk_to_rest(*state)
    run = stopping_run(*state)
    tolerance = 1e-7 * (np.ptp(positions) + state[3])
    assert abs(run[0] - positions.max()) < tolerance
    assert abs(run[1] - positions.min()) < tolerance
    assert abs(run[2] - positions[-1]) < tolerance


def test_every_brake_of_a_grid_goes_as_far_as_its_closed_sums_say():
    """Also where a joint moves one way first and comes to rest on the other side, which random states seldom do."""
    turned_round, j = 0, 0.3
    grid = product((0.6, 1.0, 2.5, 7.3, 15.0), np.linspace(-1.0, 1.0, 15), np.linspace(-1.5, 1.5, 31))
    for size, share, speed in grid:
        most = size * j
        a = share * most
        state = speed * (abs(released(a, j)) + 0.3 * most), a, most, j
        positions, _ = walk_to_rest(*state)
        run = stopping_run(*state)
        walked = positions.max(), positions.min(), positions[-1]
        assert tuple(run) == pytest.approx(walked, abs=1e-9), state
        assert max(run[0], -run[1]) <= longest_run(*map(np.abs, state)), state
        turned_round += run[0] > 1e-9 and run[1] < -1e-9
    assert turned_round > 50


@given(states())
def test_braking_obeys_acceleration_and_jerk(state):
    _, _, most, j = state
    _, accelerations = walk_to_rest(*state)
    assert np.abs(accelerations).max() <= most * (1.0 + 1e-12)
    assert np.abs(np.diff(accelerations)).max(initial=0.0) <= j * (1.0 + 1e-9)


@given(states())
def test_no_run_is_longer_than_the_bound(state):
    run = stopping_run(*state)
    assert max(run[0], -run[1]) <= longest_run(*map(np.abs, state))


def test_a_joint_at_rest_stays_where_it_is():
    assert not any(stopping_run(0.0, 0.0, 1.0, 1.0))
    assert braked(0.0, 0.0, 1.0, 1.0) == 0.0
