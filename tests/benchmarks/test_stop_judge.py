"""What a show's decks have to do after what was done, and whether their ticks say so."""

import numpy as np
import pytest

from benchmarks.fleet._stop_judge import BRAKE, REACH, RELINK, DeckTicks, Event, StopModel, violations

MEMBERS = ("conductor", "a", "b", "c", "d")


def musts(*events, until=100.0, paused_after=2.5):
    """When each deck has to be in the emergency stop: rounded (name, begins, ends)."""
    model = StopModel(paused_after)
    for name in MEMBERS:
        model.take(Event(0.0, 0.0, "start", name))
        model.take(Event(1.0, 1.0, "started", name))
    for at, what, name in events:
        model.take(Event(at, at, what, name))
    return [(must.name, round(must.begins, 3), must.ends) for must in model.finish(until)]


def test_a_press_is_owed_by_all_until_each_is_reset_and_a_second_press_again():
    owed = musts((10, "press", "a"), (20, "reset", "b"), (30, "press", "a"))
    assert ("b", 10 + REACH, 20) in owed
    assert ("b", 30 + REACH, 100) in owed
    assert ("a", 10, 100) in owed
    assert [name for name, *_ in owed].count("c") == 1


def test_a_deck_that_was_cut_owes_it_once_it_is_linked_to_one_that_holds_it():
    cut = (10, "cut", "d"), (11, "press", "a")
    assert not any(name == "d" for name, *_ in musts(*cut))
    assert ("d", 20 + RELINK, 100) in musts(*cut, (20, "heal", "d"))
    none_holds = [(12, "killed", "conductor"), *((13, "reset", name) for name in "abc")]
    assert not any(name == "d" for name, *_ in musts(*cut, *none_holds, (20, "heal", "d")))


def test_a_stop_comes_over_a_deck_that_it_is_new_to():
    parted = [(10, "part", f"{one} d") for one in ("conductor", "a", "c")]
    assert ("d", 11 + REACH, 100) in musts(*parted, (11, "press", "a"))
    assert not any(name == "d" for name, *_ in musts(*parted, (10, "freeze", "b"), (11, "press", "a")))


@pytest.mark.parametrize("linked", [True, False])
def test_a_deck_that_was_not_reset_owes_it_from_its_first_tick_on(linked):
    events = [(10, "press", "a"), (12, "killed", "b"), *([] if linked else [(13, "cut", "b")])]
    assert ("b", 14, 100) in musts(*events, (14, "start", "b"), (15, "started", "b"))
    assert not any(name == "b" for name, *_ in musts((9, "killed", "b"), *events[2:], (14, "start", "b")))


def test_a_deck_that_starts_beside_one_that_holds_a_stop_owes_it_from_its_first_tick_on():
    events = (9, "killed", "b"), (10, "press", "a"), (14, "start", "b"), (15, "started", "b")
    assert ("b", 14, 100) in musts(*events)
    over = [(11, "reset", name) for name in "acd"]
    assert not any(name == "b" for name, *_ in musts(*events[:2], *over, (13, "over", "conductor"), *events[2:]))


def test_ticks_that_play_or_move_are_found():
    model = StopModel(np.inf)
    for what in ("start", "started", "press"):
        model.take(Event(0.0, 0.0, what, "a"))
    owed = model.finish(10.0)
    times = np.arange(0.0, 10.0, 0.02)
    still, late = np.zeros(len(times)), BRAKE + 1.0

    def found(stopped, turned):
        return [what.partition(" in ")[0] for _, what in violations(owed, {"a": DeckTicks(times, stopped, turned)})]

    assert found(times >= 0.0, still) == []
    assert found(times != times[50], still) == ["not stopped"]
    assert found(times >= 0.0, np.where(times > late, 1e-6, 0.0)) == ["moved"]
    assert found(times >= 0.0, np.where(times < BRAKE, 0.1, 0.0)) == []
