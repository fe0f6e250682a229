"""The estimate of a remote clock, against simulated networks and clocks that are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motiondeck.shows.clock_estimate import ClockEstimate, RoundTrip

NETWORKS = st.fixed_dictionaries(
    {
        "offset": st.floats(-1e6, 1e6),
        "drift": st.floats(-3e-4, 3e-4),
        "delay": st.floats(1e-5, 0.05),
        "unequal": st.floats(-0.5, 0.5),
        "jitter": st.floats(0.0, 0.01),
        "seed": st.integers(0, 2**31),
    }
)


def remote_clock(offset, drift):
    return lambda local: offset + (1.0 + drift) * local


def exchange(estimate, clock, seconds, delay, unequal, jitter, seed, began=1000.0):
    """Round trips four times a second: fixed delays of both ways, and waits in queues that nobody knows."""
    rng = np.random.default_rng(seed)
    for local in np.arange(began, began + seconds, 0.25):
        there = delay * (1.0 + unequal) + rng.exponential(jitter + 1e-9)
        back = delay * (1.0 - unequal) + rng.exponential(jitter + 1e-9)
        estimate.take(RoundTrip(local, clock(local + there), local + there + back))
    return began + seconds


@given(NETWORKS)
def test_the_error_is_within_what_is_said(network):
    clock = remote_clock(network.pop("offset"), network.pop("drift"))
    estimate = ClockEstimate()
    now = exchange(estimate, clock, 20.0, **network)
    for ahead in (0.0, 3.0):
        error = abs(estimate.remote(now + ahead) - clock(now + ahead))
        assert error <= estimate.uncertainty(now + ahead) + 1e-6


@given(NETWORKS)
def test_local_undoes_remote(network):
    clock = remote_clock(network.pop("offset"), network.pop("drift"))
    estimate = ClockEstimate()
    now = exchange(estimate, clock, 5.0, **network)
    assert abs(estimate.local(estimate.remote(now + 7.0)) - now - 7.0) < 1e-6


def test_equal_ways_with_queues_leave_less_than_half_a_millisecond_and_20_ppm():
    errors, drifts = [], []
    for seed in range(20):
        clock, estimate = remote_clock(5e4, 1e-4), ClockEstimate()
        now = exchange(estimate, clock, 30.0, delay=0.02, unequal=0.0, jitter=0.002, seed=seed)
        errors.append(abs(estimate.remote(now) - clock(now)))
        drifts.append(abs(estimate.drift - 1e-4))
    assert max(errors) < 5e-4
    assert max(drifts) < 4e-5


def test_a_packet_that_was_sent_again_counts_for_nothing():
    clock, estimate = remote_clock(10.0, 0.0), ClockEstimate()
    now = exchange(estimate, clock, 10.0, delay=0.02, unequal=0.0, jitter=0.0, seed=0)
    estimate.take(RoundTrip(now, clock(now + 0.26), now + 0.28))
    assert abs(estimate.remote(now) - clock(now)) < 1e-4


def test_another_clock_is_taken_after_three_answers():
    estimate = ClockEstimate()
    now = exchange(estimate, remote_clock(10.0, 0.0), 10.0, delay=0.001, unequal=0.0, jitter=0.0, seed=0)
    other = remote_clock(70.0, 0.0)
    exchange(estimate, other, 0.5, delay=0.001, unequal=0.0, jitter=0.0, seed=0, began=now)
    assert abs(estimate.offset(now) - 10.0) < 0.01
    exchange(estimate, other, 0.5, delay=0.001, unequal=0.0, jitter=0.0, seed=0, began=now + 0.5)
    assert abs(estimate.offset(now) - 70.0) < 0.01


@pytest.mark.thorough
def test_a_few_good_answers_among_many_that_waited_on_one_way_are_enough():
    """One in 60 waits nowhere; the others wait mostly on their way there, as on a machine that is busy."""
    errors = []
    for seed in range(10):
        rng, clock, estimate = np.random.default_rng(seed), remote_clock(5e4, 1e-4), ClockEstimate()
        for local in np.arange(0.0, 180.0, 0.25):
            free = rng.random() < 1.0 / 60.0
            there = 0.02 + (0.0 if free else rng.uniform(0.002, 0.02))
            back = 0.02 + (0.0 if free else rng.uniform(0.0, 0.005))
            estimate.take(RoundTrip(local, clock(local + there), local + there + back))
            if local > 120.0:
                errors.append(abs(estimate.remote(local) - clock(local)))
    assert np.percentile(errors, 99) < 1e-3
