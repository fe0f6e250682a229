import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.physics.walking.capture_point import follow, pendulum_rate, planned_capture_point, run_away

rates = st.floats(2.0, 8.0)
coordinates = st.floats(-1.0, 1.0)


@st.composite
def courses(draw):
    """Knots of a centre of pressure that begins at 0 s."""
    count = draw(st.integers(2, 7))
    lengths = [draw(st.floats(0.05, 1.0)) for _ in range(count - 1)]
    points = [[draw(coordinates), draw(coordinates)] for _ in range(count)]
    return np.concatenate([[0.0], np.cumsum(lengths)]), np.array(points)


def pressure_at(times, points, now):
    return np.array([np.interp(now, times, points[:, axis]) for axis in range(2)])


@given(courses(), rates)
def test_a_body_on_the_planned_capture_point_ends_where_the_pressure_ends(course, omega):
    times, points = course
    capture = planned_capture_point(times, points, 0.0, omega)
    # Between knots the pressure is linear: xi' = omega (xi - p) has an exact solution.
    for begin, end, here, there in zip(times, times[1:], points, points[1:], strict=False):
        length = end - begin
        slope = (there - here) / length
        capture = there + slope / omega + np.exp(omega * length) * (capture - here - slope / omega)
    # What rounding leaves grows with e^(omega t).
    assert np.allclose(capture, points[-1], atol=1e-12 * np.exp(omega * times[-1]) + 1e-9)


@given(courses(), rates, st.floats(0.0, 1.0))
def test_the_plan_obeys_the_pendulum_at_any_time(course, omega, share):
    times, points = course
    now, step = share * (times[-1] - 1e-3), 1e-5
    middle = now + 0.5 * step
    if np.abs(times - middle).min() < step:
        return
    velocity = (
        planned_capture_point(times, points, now + step, omega) - planned_capture_point(times, points, now, omega)
    ) / step
    pushed = omega * (planned_capture_point(times, points, middle, omega) - pressure_at(times, points, middle))
    assert np.allclose(velocity, pushed, atol=1e-3)


@given(courses(), rates, coordinates)
def test_where_the_world_is_does_not_matter(course, omega, shift):
    times, points = course
    moved = planned_capture_point(times, points + shift, 0.0, omega)
    assert np.allclose(moved, planned_capture_point(times, points, 0.0, omega) + shift)


def test_after_the_last_knot_it_stays_where_the_pressure_is():
    times, points = np.array([0.0, 1.0]), np.array([[0.0, 0.0], [1.0, 2.0]])
    assert np.array_equal(planned_capture_point(times, points, 5.0, 3.0), [1.0, 2.0])


def test_a_jump_of_the_pressure_is_seen_coming():
    times, points = np.array([0.0, 1.0, 1.0, 2.0]), np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 0.0]])
    assert planned_capture_point(times, points, 0.0, 3.0)[0] == pytest.approx(np.exp(-3.0), rel=1e-6)


def test_the_centre_of_mass_runs_after_the_capture_point():
    centre, target, omega = np.array([0.0, 1.0]), np.array([1.0, 0.0]), pendulum_rate(1.0)
    assert omega == pytest.approx(9.81**0.5)
    for _ in range(1000):
        centre = follow(centre, target, 0.005, omega)
    assert np.allclose(centre, target, atol=1e-6)


@given(coordinates, coordinates, st.floats(0.0, 0.1), rates)
def test_it_runs_away_from_a_pressure_that_stays(start, pressure, seconds, omega):
    there, steps = start, 1000
    for _ in range(steps):
        there += seconds / steps * omega * (there - pressure)
    assert run_away(np.array([start]), np.array([pressure]), seconds, omega) == pytest.approx(there, abs=2e-3)
