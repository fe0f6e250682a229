"""Motions are found by their frequencies, the nearest first, and parts of the body count as much as they should."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.centralized.motion_index import MotionIndex
from motiondeck_base.errors import MotiondeckError


def many(count, width=4, seed=0):
    frequencies = np.exp(np.random.default_rng(seed).uniform(0, 3, (count, width)))
    return [f"motion {i}" for i in range(count)], frequencies


@given(st.integers(1, 40), st.integers(0, 100), st.lists(st.floats(0.1, 5), min_size=4, max_size=4))
def test_the_tree_answers_like_a_search_through_all(count, seed, weights):
    names, frequencies = many(count, seed=seed)
    asked = many(1, seed=seed + 1)[1][0]
    share = np.array(weights) / np.sum(weights)
    distance = np.sqrt((np.square(np.log(frequencies) - np.log(asked)) * share).sum(1))
    found = MotionIndex(names, frequencies, np.array(weights)).nearest(asked, 3)
    assert [f.name for f in found] == [names[i] for i in np.argsort(distance)[:3]]
    assert [f.distance for f in found] == pytest.approx(sorted(distance)[:3])


def test_a_hundred_thousand_motions_hold_each_other_apart():
    names, frequencies = many(100_000)
    index = MotionIndex(names, frequencies)
    for row in (0, 777, 99_999):
        assert index.nearest(frequencies[row] * 1.0001, 1)[0].name == names[row]


def test_a_part_that_does_not_count_is_not_compared():
    frequencies = np.array([[1.0, 10.0], [1.5, 3.0]])
    assert MotionIndex(["a", "b"], frequencies, np.array([1.0, 0.0])).nearest(np.array([1.1, 3.0]))[0].name == "a"
    assert MotionIndex(["a", "b"], frequencies, np.array([0.0, 1.0])).nearest(np.array([1.1, 3.0]))[0].name == "b"


def test_a_tenth_faster_is_a_tenth_away():
    names, frequencies = many(5)
    assert MotionIndex(names, frequencies).nearest(1.1 * frequencies[2], 1)[0].distance == pytest.approx(np.log(1.1))


def test_impossible_questions_are_refused():
    names, frequencies = many(3)
    with pytest.raises(MotiondeckError, match="one row a motion"):
        MotionIndex([], np.zeros((0, 2)))
    with pytest.raises(MotiondeckError, match="motion 1"):
        MotionIndex(names, frequencies * np.array([[1], [-1], [1]]))
    with pytest.raises(MotiondeckError, match="weights"):
        MotionIndex(names, frequencies, np.ones(3))
    with pytest.raises(MotiondeckError, match="zero"):
        MotionIndex(names, frequencies, np.zeros(4))
    with pytest.raises(MotiondeckError, match="2 frequencies"):
        MotionIndex(names, frequencies).nearest(np.ones(2))
    with pytest.raises(MotiondeckError, match="center 0"):
        MotionIndex(names, frequencies).nearest(-np.ones(4))
