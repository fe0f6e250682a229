import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from controller.loop.histogram import DurationHistogram, Percentiles

durations = st.lists(st.integers(0, 2**40), min_size=1, max_size=200)


def counted(values):
    histogram = DurationHistogram()
    for value in values:
        histogram.add(value)
    return histogram


@given(durations, st.floats(0.0, 1.0))
def test_a_percentile_errs_by_a_64th_at_most(values, share):
    exact = np.sort(values)[max(int(np.ceil(share * len(values))), 1) - 1] / 1000.0
    assert abs(counted(values).percentile(share) - exact) <= exact / 64.0 + 1e-9


def test_the_maximum_is_exact():
    assert counted([1_234_567, 5]).percentiles().max == 1234.567


def test_what_is_negative_counts_as_zero_and_what_is_endless_as_the_longest():
    histogram = counted([-5, 2**60])
    assert histogram.percentile(0.5) == 0.0
    assert histogram.percentiles().max == 2**60 / 1000.0


def test_nothing_counted_says_zero():
    histogram = DurationHistogram()
    assert histogram.percentiles() == Percentiles(0.0, 0.0, 0.0, 0.0)
    assert histogram.percentile(0.99) == 0.0
