"""A network that is too large for its tick is refused before anything is opened."""

import itertools

import pytest

import synthetic
from controller.loop.clock import RateError
from motiondeck.run.spec.program import TIMED_FRAMES, checked_rate, frame_seconds
from motiondeck_base.errors import MotiondeckError


@pytest.fixture(scope="module")
def library():
    return synthetic.small_library()


def test_a_network_that_is_small_enough_is_played_as_wanted(library):
    assert checked_rate(library, "march", 200.0, cost=0.0024) == 200.0


def test_one_that_is_too_large_is_refused_with_the_rate_that_it_can_hold(library):
    with pytest.raises(MotiondeckError, match=r"needs 2.60 ms of the 5.00 ms of a tick.*can hold --rate 192"):
        checked_rate(library, "march", 200.0, cost=0.0026)
    assert checked_rate(library, "march", 192.0, cost=0.0026) == 192.0
    assert checked_rate(library, "march", 200.0, cost=0.0026, lower=True) == 192.0


def test_below_the_recorded_rate_a_tick_has_several_frames(library):
    assert checked_rate(library, "march", 60.0, cost=0.004) == 60.0
    with pytest.raises(MotiondeckError, match="at any rate"):
        checked_rate(library, "march", 60.0, cost=0.005)


def test_the_quickest_batch_counts_and_nothing_that_plays_is_changed(library):
    before = library.network.snapshot()
    ticks = itertools.chain([0.0, 9.0], itertools.count(10.0, 0.5))
    assert frame_seconds(library, "march", lambda: next(ticks)) == pytest.approx(0.5 / 20)
    assert repr(library.network.snapshot()) == repr(before)
    assert TIMED_FRAMES == 100


@pytest.mark.parametrize("rate", [0.0, -1.0, 1e9, float("nan")])
def test_a_rate_at_which_no_loop_runs_is_refused(library, rate):
    with pytest.raises(RateError, match="cannot run at"):
        checked_rate(library, "march", rate, lower=True)
