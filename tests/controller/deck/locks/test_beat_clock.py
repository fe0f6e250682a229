"""The beat clock finds period and phase of any beat in its range, and keeps them through what people do to beats."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from controller.deck.locks.beat_clock import LONGEST, SHORTEST, BeatClock

PERIODS = st.floats(SHORTEST, LONGEST)
RATES = st.floats(80.0, 140.0)


def heard(times):
    clock = BeatClock()
    for time in times:
        clock.beat(time)
    return clock


def off(clock, time, period, start=0.0):
    """How far the clock's beats are from the true ones near a time, s."""
    wrong = (clock.last - start) % period
    return (
        abs(wrong - period if wrong > period / 2 else wrong)
        + abs(time - clock.last) * abs(clock.period - period) / period
    )


@given(PERIODS, st.floats(0.0, 1e4))
def test_every_period_in_the_range_is_captured_at_the_second_beat(period, start):
    clock = heard([start, start + period])
    assert clock.period == pytest.approx(period, abs=1e-9)
    assert heard(start + period * np.arange(12)).period == pytest.approx(period, abs=1e-6)


@pytest.mark.parametrize("period", [0.2, 1.6])
def test_a_period_beyond_the_range_is_not(period):
    clock = heard(period * np.arange(2))
    assert clock.period is None


@given(RATES, st.integers(0, 2**32 - 1))
def test_jittered_beats_are_averaged(rate, seed):
    period, generator = 60.0 / rate, np.random.default_rng(seed)
    times = period * np.arange(40) + generator.normal(0.0, 0.015, 40).clip(-0.04, 0.04)
    clock, errors = BeatClock(), []
    for number, time in enumerate(times):
        clock.beat(time)
        if number >= 8:
            errors.append(clock.last - number * period)
    # Of single beats the root mean square is 15 ms.
    assert np.sqrt(np.mean(np.square(errors))) < 0.0145
    assert clock.period == pytest.approx(period, abs=0.02)


@given(RATES, st.sets(st.integers(3, 38), max_size=20))
def test_lost_beats_change_nothing(rate, lost):
    period = 60.0 / rate
    clock = heard([period * number for number in range(40) if number not in lost])
    assert off(clock, 40 * period, period) < 1e-6


@given(RATES, st.integers(0, 2**32 - 1), st.floats(0.02, 0.12))
def test_double_taps_change_nothing(rate, seed, after):
    period, generator = 60.0 / rate, np.random.default_rng(seed)
    doubled = [[beat, beat + after] if generator.random() < 0.5 else [beat] for beat in period * np.arange(20)]
    clock = heard(np.concatenate(doubled))
    assert off(clock, 20 * period, period) < 1e-6


@given(st.floats(100.0, 120.0), st.floats(-1.0, 1.0))
def test_a_tempo_that_changes_is_followed_as_far_behind_as_the_loop_promises(rate, ramp):
    times, clock, errors = [0.0], BeatClock(), []
    while times[-1] < 20.0:
        times.append(times[-1] + 60.0 / (rate + ramp * times[-1]))
    for time in times:
        clock.beat(time)
        errors.append(time - clock.last)
    # (1 - g) / h times the change of the period from beat to beat.
    longest = np.diff(times).max()
    assert np.abs(errors).max() < 1.1 * 0.49 / 0.09 * longest**3 * abs(ramp) / 60.0 + 1e-6


def test_beats_in_whole_ms_are_taken_alike_whatever_their_last_bits_are():
    """Beats came to lie just at a limit of the clock; it and its twin of 32 bits decided differently."""
    generator = np.random.default_rng(0)
    for _ in range(500):
        since = generator.choice([5, 50, 100, 245, 250, 325, 350, 450, 500, 650, 1000, 1530, 2550], 8)
        times = 1e-3 * np.cumsum(since)
        for one in (heard(times * (1.0 + 1e-7)), heard(times * (1.0 - 1e-7))):
            assert (one.counted, one.period) == pytest.approx((heard(times).counted, heard(times).period), rel=1e-4)


@given(RATES, RATES)
@example(89.0, 138.0)  # two of three beats fall near the old ones
@example(138.2, 84.3)
def test_another_tempo_is_captured_anew(rate, then):
    before = 60.0 / rate * np.arange(10)
    after = before[-1] + 60.0 / then * np.arange(1, 25)
    clock = heard([*before, *after])
    assert clock.period == pytest.approx(60.0 / then, rel=0.02)
    assert off(clock, after[-1], 60.0 / then, after[-1]) < 0.015


def test_a_beat_lost_at_the_start_does_not_halve_the_tempo():
    times = 0.6 * np.array([0, 2, 3, 4, 5, 6, 7, 8])
    assert heard(times).period == pytest.approx(0.6)


def test_after_a_long_silence_it_begins_anew_and_keeps_its_period_until_then():
    clock = heard([*(0.5 * np.arange(6)), 60.1])
    assert (clock.period, clock.last, clock.counted) == (0.5, 60.1, 1)
    clock.beat(60.8)
    assert clock.period == pytest.approx(0.7)


@given(st.lists(st.floats(-10.0, 100.0), max_size=50))
def test_whatever_it_hears_its_numbers_are_in_their_ranges(times):
    clock = heard(times)
    assert clock.period is None or SHORTEST <= clock.period <= LONGEST
    assert np.isfinite(clock.last)
