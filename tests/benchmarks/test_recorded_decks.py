"""What recordings of decks say about each other: by when ticks were due, and by when they began."""

import numpy as np
import pytest

from benchmarks.fleet._recorded_decks import RecordedDeck, apart_ms, longest_beyond, undisturbed

PERIOD, ROUND = 0.01, 0.8


def recorded(late, behind=0.0):
    """A deck of which each tick begins so much later than it is due, s; its phase is that of the time when due."""
    due = 5.0 + PERIOD * np.arange(200)
    fields = {"phase": (due - behind) / ROUND % 1.0, "playing": np.zeros(200)}
    return RecordedDeck(due + late, due, fields, ["walk"])


def test_decks_that_wait_for_a_core_are_in_step_by_due_and_apart_by_begun():
    decks = [recorded(0.0), recorded(0.004), recorded(0.001)]
    times = np.arange(5.1, 6.9, 0.01)
    assert apart_ms(decks, times, ROUND, by_due=True).max() < 1e-6
    assert apart_ms(decks, times, ROUND) == pytest.approx(np.full(len(times), 4.0))
    assert decks[1].played("walk", 5.502) == (pytest.approx(5.504), pytest.approx(5.5))


def test_a_deck_that_is_behind_is_apart_either_way():
    decks = [recorded(0.0), recorded(0.0, behind=0.02)]
    times = np.arange(5.1, 6.9, 0.01)
    assert apart_ms(decks, times, ROUND, by_due=True) == pytest.approx(np.full(len(times), 20.0))


def test_the_second_after_a_stall_is_set_apart():
    stalls = np.array([[6.0, 0.05], [8.0, 0.002]])
    free = undisturbed(np.array([5.9, 5.97, 6.5, 7.1, 8.0]), stalls)
    assert free.tolist() == [True, False, False, True, True]
    assert undisturbed(np.arange(3.0), np.empty((0, 2))).all()


@pytest.mark.parametrize(("apart", "longest"), [([1, 2], 0.0), ([11, 1, 12, 13, 2], 0.2), ([1, 11, 11, 11], 0.3)])
def test_the_longest_stretch_apart(apart, longest):
    assert longest_beyond(np.array(apart, dtype=float), 0.1) == pytest.approx(longest)
