import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.learning.recognition.labelled_recordings import PROTOCOLS, folds, inner_folds
from motiondeck_base.errors import MotiondeckError

LABELS = np.repeat([0, 1, 2], 8)
ACTORS = np.tile([0, 0, 1, 1, 2, 2, 3, 3], 3)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_nothing_is_both_learned_and_asked(protocol):
    for learn, ask in folds(protocol, LABELS, ACTORS):
        assert not set(learn) & set(ask)
        assert set(LABELS[ask]) <= set(LABELS[learn])


def test_actor_out_asks_everybody_once_and_knows_nobody():
    asked = []
    for learn, ask in folds("actor-out", LABELS, ACTORS):
        assert not set(ACTORS[learn]) & set(ACTORS[ask])
        asked += ask.tolist()
    assert sorted(asked) == list(range(24))


def test_one_actor_learns_one_actor():
    for learn, ask in folds("one-actor", LABELS, ACTORS):
        assert len(set(ACTORS[learn])) == 1
        assert len(ask) == 18


@given(st.integers(0, 10_000))
def test_half_learns_half_of_each_class(seed):
    for learn, _ in folds("half", LABELS, ACTORS, seed):
        assert np.array_equal(np.bincount(LABELS[learn]), [4, 4, 4])


def test_a_class_that_was_not_learned_is_not_asked():
    labels = np.array([0, 0, 1, 1, 2])
    actors = np.array([0, 1, 0, 1, 1])
    for learn, ask in folds("actor-out", labels, actors):
        assert 4 not in ask or 4 in learn


def test_one_actor_alone_cannot_be_left_out():
    with pytest.raises(MotiondeckError, match="two actors or more; use 'half'"):
        folds("actor-out", LABELS, np.zeros(24, dtype=int))


def test_too_few_examples_are_refused():
    with pytest.raises(MotiondeckError, match="no split"):
        folds("half", np.array([0, 1]), np.array([0, 0]))


def test_inner_splits_go_by_actor_where_there_are_several():
    assert len(inner_folds(LABELS, ACTORS)) == 4
    assert len(inner_folds(LABELS, np.zeros(24, dtype=int))) == 3
