import itertools

import pytest

from benchmarks.simulated_time import VirtualClock
from controller.loop.clock import RateError, Ticker

PERIOD = 5_000_000


@pytest.fixture
def world(monkeypatch):
    """A world whose time only passes when somebody sleeps, or looks at the clock (1 us)."""

    class World:
        time = 1_000
        oversleep = 0

        def look(self):
            self.time += 1_000
            return self.time

        def sleep(self, seconds):
            self.time += int(seconds * 1e9) + self.oversleep

    world = World()
    monkeypatch.setattr("controller.loop.clock.time.monotonic_ns", world.look)
    monkeypatch.setattr("controller.loop.clock.time.sleep", world.sleep)
    return world


def test_deadlines_do_not_drift_whatever_the_work_takes(world):
    ticker = Ticker(200.0)
    ticker.start()
    start = world.time
    for tick in range(1, 1000):
        world.time += (tick * 7919) % 4_000_000
        assert 0 <= ticker.wait() <= 2_000
        assert 0 <= world.time - (start + tick * PERIOD) <= 2_000
    assert (ticker.overruns, ticker.skipped) == (0, 0)


def test_lateness_is_what_the_sleep_took_too_long(world):
    ticker = Ticker(200.0)
    ticker.start()
    world.oversleep = 700_000
    assert 500_000 <= ticker.wait() <= 502_000  # the spin window took the rest


def test_an_overrun_skips_what_was_missed_and_stays_in_step(world):
    ticker = Ticker(200.0)
    ticker.start()
    start = world.time
    world.time += 17_000_000  # ticks 1, 2 and 3 are due in here
    ticker.wait()
    assert (ticker.overruns, ticker.skipped) == (1, 2)
    assert ticker.wait() <= 2_000
    assert 0 <= world.time - (start + 4 * PERIOD) <= 2_000


def test_an_overrun_catches_up_when_told_so(world):
    ticker = Ticker(200.0, policy="catch_up")
    ticker.start()
    start = world.time
    world.time += 17_000_000
    lateness = [ticker.wait() for _ in range(4)]
    assert [late // 1_000_000 for late in lateness] == [12, 7, 2, 0]
    assert (ticker.overruns, ticker.skipped) == (2, 0)
    assert 0 <= world.time - (start + 4 * PERIOD) <= 2_000


def test_starting_anew_forgets_what_was(world):
    ticker = Ticker(200.0)
    world.time += 17_000_000
    ticker.wait()
    ticker.start()
    assert (ticker.overruns, ticker.skipped) == (0, 0)
    assert ticker.wait() <= 2_000


def after_tick_of(other, world):
    """How long after a tick of another clock, which is `other` ahead, it is, ns."""
    return (world.time + other + PERIOD // 2) % PERIOD - PERIOD // 2


@pytest.mark.parametrize("other", [0, 300_000, 2_600_000, 4_990_000, -7_123_456_789])
def test_ticks_are_moved_onto_those_of_another_clock_a_hundredth_of_a_period_at_a_time(world, other):
    ticker = Ticker(200.0)
    ticker.start()
    ticker.align(0, other)
    times = [ticker.now()]
    for _ in range(300):
        ticker.wait()
        times.append(ticker.now())
    assert abs(after_tick_of(other, world)) < 5_000
    lengths = [after - before for before, after in itertools.pairwise(times)]
    assert min(lengths) > 0.999 * PERIOD
    assert max(lengths) < 1.011 * PERIOD
    assert (ticker.overruns, ticker.skipped) == (0, 0)


def test_ticks_follow_a_clock_that_drifts(world):
    ticker = Ticker(200.0)
    ticker.start()
    for drift in (1e-4, -1e-4):
        for _ in range(40):
            now = world.time
            ticker.align(now, round(now * (1.0 + drift)))
            for _ in range(50):
                ticker.wait()
        assert abs(after_tick_of(round(world.time * drift), world)) < 40_000


def test_the_virtual_clock_is_always_on_time():
    clock = VirtualClock(120.0)
    clock.start()
    assert [clock.wait() for _ in range(12)] == [0] * 12
    assert clock.now() * 1e-9 == pytest.approx(0.1, abs=1e-7)
    assert clock.period == pytest.approx(1.0 / 120.0, rel=1e-6)
    clock.start()
    assert (clock.now(), clock.overruns) == (0, 0)


@pytest.mark.parametrize("kind", [Ticker, VirtualClock])
@pytest.mark.parametrize("rate", [0.0, -5.0, float("nan"), float("inf"), 1e6])
def test_an_impossible_rate_is_refused(kind, rate):
    with pytest.raises(RateError, match="1 to 10000"):
        kind(rate)
