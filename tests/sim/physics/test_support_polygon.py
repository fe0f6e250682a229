import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.physics.balance import convex_hull, margin

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
points = st.lists(st.tuples(st.integers(-50, 50), st.integers(-50, 50)), min_size=1, max_size=12)


def test_the_margin_is_the_way_to_the_nearest_border_and_negative_outside():
    assert margin(SQUARE, np.array([0.5, 0.5])) == pytest.approx(0.5)
    assert margin(SQUARE, np.array([1.9, 0.5])) == pytest.approx(0.1)
    assert margin(SQUARE, np.array([5.0, 5.0])) == pytest.approx(-5.0)
    assert margin(SQUARE, np.array([1.0, -0.25])) == pytest.approx(-0.25)


def test_what_touches_no_floor_supports_nothing():
    assert margin(np.empty((0, 2)), np.zeros(2)) == -np.inf


@given(points)
def test_every_point_is_inside_its_hull_and_corners_turn_left(given_points):
    cloud = np.array(given_points, dtype=float)
    hull = convex_hull(cloud)
    assert {tuple(corner) for corner in hull} <= {tuple(point) for point in cloud}
    assert min(margin(hull, point) for point in cloud) >= -1e-9
    if len(hull) > 2:
        edge = np.roll(hull, -1, axis=0) - hull
        following = np.roll(edge, -1, axis=0)
        assert np.all(edge[:, 0] * following[:, 1] - edge[:, 1] * following[:, 0] > 0.0)
