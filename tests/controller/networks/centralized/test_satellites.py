"""Satellites answer as their equations say, wherever they are placed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from controller.networks.centralized.satellites import (
    GaussianSatellites,
    HarmonicSatellites,
    PolynomialSatellites,
    SatelliteError,
    grid_places,
    logistic,
    lowest_orders,
    quasi_random_places,
)

states = arrays(np.float64, (5, 3), elements=st.floats(-2, 2))


@given(states, arrays(np.float64, (4, 3), elements=st.floats(-2, 2)), arrays(np.float64, 4, elements=st.floats(0.1, 8)))
def test_gaussian_satellites_are_equations_4_and_5(q, places, sharpness):
    response = GaussianSatellites(places, sharpness).respond(q)
    for k in range(5):
        for j in range(4):
            radius = sharpness[j] * np.linalg.norm(q[k] - places[j])
            assert response[k, j] == pytest.approx(np.exp(-0.5 * radius**2), abs=1e-12)


def test_a_gaussian_satellite_is_one_at_its_place_and_nothing_far_away():
    satellites = GaussianSatellites(np.array([[0.5, 0.5], [-0.5, 0.0]]), np.array([5.0, 5.0]))
    assert satellites.respond(np.array([0.5, 0.5]))[0] == pytest.approx(1.0)
    assert satellites.respond(np.array([9.0, 9.0])).max() < 1e-100


@given(states)
def test_harmonic_and_polynomial_satellites_are_equations_3_and_6(q):
    orders = lowest_orders(3, 12)
    harmonic = HarmonicSatellites(orders, 0.7).respond(q)
    polynomial = PolynomialSatellites(orders).respond(q)
    for j, order in enumerate(orders):
        assert np.allclose(harmonic[:, j], np.cos(0.7 * (q @ order)))
        assert np.allclose(polynomial[:, j], q[:, 0] ** order[0] * q[:, 1] ** order[1] * q[:, 2] ** order[2])


@given(st.integers(1, 4), st.integers(1, 60))
def test_orders_come_once_each_by_their_sum(dimensions, count):
    orders = lowest_orders(dimensions, count)
    assert orders.shape == (count, dimensions)
    assert len({tuple(row) for row in orders}) == count
    assert (np.diff(orders.sum(1)) >= 0).all()


@given(st.integers(1, 4), st.integers(1, 120))
def test_places_fill_the_cube_and_never_coincide(dimensions, count):
    places = grid_places(dimensions, count)
    assert places.shape == (count, dimensions)
    assert np.abs(places).max() <= 1.0
    assert len(np.unique(places.round(9), axis=0)) == count


def test_quasi_random_places_repeat_with_their_seed():
    assert np.array_equal(quasi_random_places(3, 40, seed=4), quasi_random_places(3, 40, seed=4))
    assert not np.array_equal(quasi_random_places(3, 40, seed=4), quasi_random_places(3, 40, seed=5))


def test_the_sigmoid_rises_from_zero_to_one():
    h = np.linspace(-20, 20, 2001)
    s = logistic(h)
    assert (np.diff(s) > 0).all()
    assert logistic(np.array(0.0)) == pytest.approx(0.5)
    assert logistic(np.array(-1e6)) == pytest.approx(0.0, abs=1e-9)
    assert logistic(np.array(1e6)) == pytest.approx(1.0)


def test_impossible_satellites_are_refused_by_name():
    places = np.zeros((3, 2))
    with pytest.raises(SatelliteError, match="satellite 1"):
        GaussianSatellites(places, np.array([1.0, -1.0, 1.0]))
    with pytest.raises(SatelliteError, match="satellite 2"):
        GaussianSatellites(np.array([[0.0], [0.0], [np.nan]]), np.ones(3))
    with pytest.raises(SatelliteError, match="shape"):
        GaussianSatellites(places, np.ones(2))


def test_satellites_are_given_as_lists_too():
    given, lists = GaussianSatellites(np.eye(2), np.ones(2)), GaussianSatellites([[1, 0], [0, 1]], [1, 1])
    assert np.array_equal(lists.respond(np.array([0.3, 0.7])), given.respond(np.array([0.3, 0.7])))
