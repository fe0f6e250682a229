import numpy as np
import pytest

from controller.learning.preparation.kind import kind_of, pace_at_ends, periods

RATES = pytest.mark.parametrize("rate", [30.0, 60.0, 120.0])


def steps(rate, seconds, period=1.0):
    """Two joints, mm, that swing; shape (T, 6)."""
    t = 2 * np.pi * np.arange(round(seconds * rate)) / rate / period
    return 300.0 * np.stack([np.sin(t), np.cos(t), np.sin(2 * t), 0 * t, np.sin(t + 1.0), np.cos(t)], axis=1)


def gesture(rate, seconds=2.0):
    """An arm that is raised from rest and comes back to it."""
    s = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(round(seconds * rate)) / (seconds * rate))
    return 600.0 * np.stack([s, s**2, 0 * s], axis=1)


@RATES
@pytest.mark.parametrize("seconds", [2.0, 3.3, 20.0])
def test_a_gait_is_a_loop_and_its_periods_are_counted(rate, seconds):
    walk = steps(rate, seconds)
    assert periods(walk, rate) == pytest.approx(seconds, rel=0.05)
    assert kind_of(walk, rate).plays == "loop"


@RATES
def test_a_gesture_that_returns_to_its_rest_is_no_loop(rate):
    raised = gesture(rate)
    found = kind_of(raised, rate)
    assert periods(raised, rate) == 1.0
    assert pace_at_ends(raised, rate) < 0.5
    assert found.plays == "once"
    assert np.abs(raised[found.seam[0]] - raised[found.seam[1]]).max() < 5.0  # though its ends meet


@RATES
def test_one_turn_that_moves_on_through_its_ends_is_a_loop(rate):
    assert kind_of(steps(rate, 1.05), rate).plays == "loop"


@RATES
def test_what_does_not_return_is_no_loop(rate):
    t = np.arange(round(2.0 * rate)) / rate
    assert kind_of(300.0 * np.stack([t, t**2, 0 * t], axis=1), rate).plays == "once"


@pytest.mark.parametrize("plays", ["loop", "once"])
def test_what_is_given_overrules_the_figures(plays):
    for motion in (gesture(60.0), steps(60.0, 3.0)):
        found = kind_of(motion, 60.0, plays)
        assert found.plays == plays
        assert "as given" in found.decision.decided


@RATES
def test_of_rounds_that_drift_one_is_kept(rate):
    walk = steps(rate, 3.3)
    assert not kind_of(walk, rate).one_round
    found = kind_of(walk + 15.0 * np.arange(len(walk))[:, None] / rate, rate)
    assert found.plays == "loop"
    assert found.one_round
    assert found.seam[1] - found.seam[0] == pytest.approx(rate, abs=0.06 * rate)


@RATES
def test_a_turn_whose_ends_are_far_apart_is_no_loop(rate):
    turn = steps(rate, 1.05)
    for apart, plays in ((80.0, "loop"), (300.0, "once")):
        assert kind_of(turn + np.linspace(0.0, apart, len(turn))[:, None], rate).plays == plays
