import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from controller.deck.interfaces import JointLimits
from controller.loop.approach import Approach

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


def test_unhurried_it_takes_as_long_as_the_slowest_joint_needs():
    approach = Approach.within(LIMITS, np.zeros(2), np.array([0.1, 2.0]), slowness=1.0)
    assert np.isclose(approach.duration, 15.0 / 8.0 * 2.0 / 1.0)


def test_where_nothing_is_to_be_done_it_takes_no_time():
    approach = Approach.within(LIMITS, np.ones(2), np.ones(2))
    assert approach.duration == 0.0
    assert approach.at(0.0).tolist() == [1.0, 1.0]
