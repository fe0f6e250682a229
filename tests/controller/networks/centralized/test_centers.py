"""Centers keep their amplitude, and a nonlinear one swings at the frequency that the closed form says."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from controller.networks.centralized.centers import (
    Duffing,
    FrequencyError,
    HarmonicCenters,
    NonlinearCenters,
    Pendulum,
    control_for,
    pairs_at,
)

SPRINGS = [Pendulum(), Duffing(1.0, 0.3), Duffing(2.0, -0.5)]
frequencies = st.lists(st.floats(0.1, 60.0), min_size=1, max_size=4).map(np.array)


def integrated_frequency(spring, control, momentum):
    """From the time between two upward passages through q = 0, by a general integrator."""

    def passage(_, y):
        return y[0]

    passage.direction = 1.0
    guess = 2 * np.pi / float(spring.orbit(control, momentum)[0])
    run = solve_ivp(
        lambda _, y: [y[1], -control * float(spring.force(y[0]))],
        (0.0, 3.5 * guess),
        [0.0, momentum],
        method="DOP853",
        rtol=1e-12,
        atol=1e-14,
        events=passage,
    )
    passages = run.t_events[0][run.t_events[0] > 0.1 * guess]
    return 2 * np.pi / (passages[1] - passages[0])


@settings(max_examples=25)
@given(frequencies, st.floats(1e-4, 0.1))
def test_amplitude_does_not_drift(frequency, dt):
    centers = HarmonicCenters.at_phase(frequency)
    for _ in range(1000):
        centers.advance(dt)
    assert np.allclose(np.abs(centers.state), 1.0, atol=3e-12)


def test_a_hundred_thousand_steps_keep_amplitude_and_phase():
    centers = HarmonicCenters.at_phase(np.array([1.9, 12.0]), phase=0.3)
    for _ in range(100_000):
        centers.advance(0.005)
    assert np.abs(np.abs(centers.state) - 1.0).max() < 1e-10
    meant = np.exp(1j * (np.array([1.9, 12.0]) * 500.0 + 0.3))
    assert np.abs(centers.state - meant).max() < 1e-7


@given(frequencies, st.floats(-0.5, 0.5))
def test_running_backwards_returns_to_the_start(frequency, dt):
    centers = HarmonicCenters.at_phase(frequency, phase=0.3)
    before = centers.state.copy()
    centers.advance(dt)
    centers.advance(-dt)
    assert np.allclose(centers.state, before)


def test_steps_and_closed_form_agree():
    frequency, phase = np.array([2.0, 5.5]), np.array([0.1, -2.0])
    centers = HarmonicCenters.at_phase(frequency, phase)
    seen = []
    for _ in range(50):
        seen.append(centers.coordinates.copy())
        centers.advance(0.02)
    assert np.allclose(seen, pairs_at(frequency, phase, 0.02 * np.arange(50)))


def test_the_state_is_position_and_velocity():
    centers = HarmonicCenters.at_phase(np.array([3.0]), phase=0.4)
    q, minus_p = centers.coordinates.copy()
    centers.advance(1e-6)
    assert (centers.coordinates[0] - q) / 1e-6 == pytest.approx(-3.0 * minus_p, rel=1e-5)


@pytest.mark.parametrize("bad", [-2.0, 0.0, np.nan, np.inf])
def test_an_impossible_frequency_is_refused_by_name(bad):
    with pytest.raises(FrequencyError, match="center 1"):
        HarmonicCenters.at_phase(np.array([1.0, bad]))


@pytest.mark.parametrize("spring", SPRINGS)
@pytest.mark.parametrize("above", [1.05, 1.5, 20.0])
def test_the_frequency_map_is_what_integration_gives(spring, above):
    momentum = 1.3
    control = above * max(spring.least_control(momentum), 0.2)
    frequency, amplitude = spring.orbit(control, momentum)
    assert integrated_frequency(spring, control, momentum) == pytest.approx(float(frequency), rel=1e-8)
    # At the turning point all energy is in the spring.
    assert control * spring.potential(amplitude) == pytest.approx(0.5 * momentum**2, rel=1e-9)


@given(st.sampled_from(SPRINGS), st.floats(0.3, 40.0))
def test_control_for_inverts_the_frequency_map(spring, frequency):
    control = control_for(spring, frequency, 1.0)
    assert float(spring.orbit(control, 1.0)[0]) == pytest.approx(frequency, rel=1e-9)


def test_a_frequency_beyond_the_separatrix_is_refused():
    with pytest.raises(FrequencyError, match="smaller p0"):
        control_for(Pendulum(), 1e-3, 10.0)
    with pytest.raises(FrequencyError, match="center 1"):
        NonlinearCenters.at_rest(Pendulum(), np.array([1.0, 0.2]), 1.0)


@pytest.mark.parametrize("spring", SPRINGS)
def test_a_nonlinear_center_follows_the_integrated_orbit(spring):
    control = np.array([2.0, 9.0])
    centers = NonlinearCenters.at_rest(spring, control, 0.9)
    for _ in range(400):
        centers.advance(0.01)
    for i, z in enumerate(control):
        run = solve_ivp(
            lambda _, y, z=z: [y[1], -z * float(spring.force(y[0]))], (0.0, 4.0), [0.0, 0.9], rtol=1e-11, atol=1e-12
        )
        assert centers.q[i] == pytest.approx(run.y[0, -1], abs=2e-5)
        assert centers.p[i] == pytest.approx(run.y[1, -1], abs=2e-5)


@pytest.mark.thorough
@pytest.mark.parametrize("spring", SPRINGS)
def test_a_change_of_control_settles_on_the_new_orbit(spring):
    centers = NonlinearCenters.at_rest(spring, np.full(4, 4.0), 1.0)
    places = []
    for wait in (0.0, 0.21, 0.19, 0.37):  # four moments of a swing, one after the other
        centers.advance(wait)
        places.append((centers.q[0], centers.p[0]))
    centers.q, centers.p = np.transpose(places)
    centers.set_control(np.full(4, 30.0))
    for _ in range(6000):
        centers.advance(0.005)
    assert centers.energy == pytest.approx(0.5, rel=1e-3)
    assert np.abs(centers.coordinates).max() <= 1.01


@pytest.mark.parametrize("spring", SPRINGS)
def test_without_damping_it_stays_on_another_orbit(spring):
    undamped = NonlinearCenters.at_rest(spring, np.array([4.0]), 1.0, damping=0.0)
    undamped.advance(0.4)
    undamped.set_control(np.array([30.0]))
    undamped.advance(10.0)
    assert abs(float(undamped.energy[0]) - 0.5) > 0.1


@pytest.mark.thorough
@settings(max_examples=30)
@given(st.sampled_from(SPRINGS), st.floats(0.001, 2.0), st.floats(3.0, 200.0))
def test_no_step_is_so_long_that_it_blows_up(spring, dt, control):
    centers = NonlinearCenters.at_rest(spring, np.array([control]), 1.0)
    for _ in range(6):
        centers.advance(dt)
    assert np.abs(centers.coordinates).max() < 1.1
