import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.deck.interfaces import JointLimits
from controller.loop.safety.approach import Approach

LIMITS = JointLimits(*(np.array([a, b]) for a, b in ((-3, -3), (3, 3), (6, 1), (60, 20), (2000, 500))))
places = st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=2).map(np.array)


@given(places, places, st.sampled_from([1.0, 4.0]))
def test_it_leads_from_rest_to_rest_within_the_limits(start, goal, slowness):
    approach = Approach.within(LIMITS, start, goal, slowness)
    assert np.allclose(approach.at(-1.0), start, atol=1e-12) or approach.duration == 0.0
    assert np.allclose(approach.at(approach.duration + 1.0), goal, atol=1e-12)
    time = np.linspace(0.0, approach.duration, 2001)
    if approach.duration < 0.05:
        return
    rate = np.array([approach.at(t) for t in time])
    for order, most in enumerate((LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk), start=1):
        rate = np.diff(rate, axis=0) / (time[1] - time[0])
        assert (np.abs(rate).max(0) <= 1.001 * most / slowness**order + 1e-5).all()


@pytest.mark.parametrize("tight", [0, 1, 2])
def test_unhurried_it_reaches_the_tightest_limit_of_its_slowest_joint(tight):
    rates = [30.0, 600.0, 20_000.0]
    rates[tight] /= 100.0
    limits = JointLimits(*(np.array([4.0 * value, value]) for value in (-3.0, 3.0, *rates)))
    approach = Approach.within(limits, np.zeros(2), np.array([0.1, 2.0]), slowness=1.0)
    step = approach.duration / 4000
    rate, used = np.array([approach.at(step * k) for k in range(4001)]), []
    for most in (limits.velocity, limits.acceleration, limits.jerk):
        rate = np.diff(rate, axis=0) / step
        used.append((np.abs(rate).max(0) / most).max())
    assert max(used) == pytest.approx(1.0, rel=3e-3) == used[tight]


def test_where_nothing_is_to_be_done_it_takes_no_time():
    for near in (1.0, 1.0 + 1e-15):
        approach = Approach.within(LIMITS, np.ones(2), np.array([1.0, near]))
        assert approach.duration == 0.0
        assert approach.at(0.0).tolist() == [1.0, near]
