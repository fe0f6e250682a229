import pytest

from motiondeck_base.errors import UnknownNameError
from motiondeck_base.words import did_you_mean, near_names

MOTIONS = ["walk", "slow-walk", "jog", "home", "getseated", "stool-standup", "Box1"]


@pytest.mark.parametrize(
    ("typed", "meant"),
    [("wlak", "walk"), ("wal", "walk"), ("jgo", "jog"), ("WALK", "walk"), ("seat", "getseated"), ("box", "Box1")],
)
def test_what_was_meant_comes_first(typed, meant):
    assert near_names(typed, MOTIONS)[0] == meant


@pytest.mark.parametrize("typed", ["help", "kick", "x", "", "dance", "notes.txt"])
def test_a_name_that_is_far_from_all_is_offered_none(typed):
    assert near_names(typed, MOTIONS) == []
    assert did_you_mean(typed, MOTIONS) == ""
    assert "Did you mean" not in str(UnknownNameError.among("motion", typed, MOTIONS))
    assert "There are: walk, slow-walk" in str(UnknownNameError.among("motion", typed, MOTIONS))
    assert str(UnknownNameError.among("motion", "x", [f"walk-{n}" for n in range(99)])).endswith("walk-19, ....")


def test_several_are_joined_as_words():
    assert did_you_mean("jgo", ["jog"]) == " Did you mean jog?"
    assert did_you_mean("wave", ["wave-1", "wave-22", "wave-333"]) == " Did you mean wave-1, wave-22 or wave-333?"
