"""The largest push is the last before the first fall, and comes once, for 0.1 s, from its side."""

import numpy as np
import pytest

from benchmarks.robots.largest_push import MOST, largest, last_survived, one_push


def test_the_first_fall_ends_the_search_also_where_a_harder_push_is_survived():
    assert last_survived(lambda size: size <= 1.0 or size > 2.0) == 1.0
    assert last_survived(lambda size: False) == 0.0
    assert last_survived(lambda size: True) == MOST


def test_a_push_has_its_impulse_and_comes_once():
    force, times = one_push(0.3, 0.5 * np.pi, 1.0), np.arange(0.0, 3.0, 0.001)
    pushed = np.array([force(now) for now in times])
    assert pushed.sum(axis=0) * 0.001 == pytest.approx([0.0, 0.3, 0.0], abs=0.004)
    assert np.all(np.diff(np.flatnonzero(pushed[:, 1])) == 1)


def test_a_robot_takes_a_usual_push_while_it_walks(monkeypatch):
    monkeypatch.setattr("benchmarks.robots.largest_push.MOST", 1.0)
    monkeypatch.setattr("benchmarks.robots.largest_push.STEP", 1.0)
    name, side, impulse, size = largest("servo20", "walk", "left", 1)
    assert (name, side, size) == ("servo20", "left", 1.0)
    assert impulse == pytest.approx(0.24, abs=0.01)
