"""The stop state: explored over all orders of events to a depth, and over long random ones."""

from copy import deepcopy

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.loop.stop_state import EmergencyStopError, StopState

SOURCES = ("door", "wire")
EVENTS = (
    *[("press", source) for source in SOURCES],
    ("pull", True),
    ("pull", False),
    ("rested",),
    ("reset",),
    ("go on",),
    ("lose",),
    ("regain",),
)
CHANGES = {
    ("running", "braking"),
    ("braking", "latched"),
    ("braking", "held"),
    ("braking", "running"),
    ("latched", "held"),
    ("held", "latched"),
    ("held", "running"),
}


def happen(state, event):
    """Carries out an event; whether it was taken."""
    try:
        match event:
            case "press", source:
                state.press(source)
            case "pull", pulled:
                state.pull("wire", pulled)
            case ("rested",):
                state.rested()
            case ("reset",):
                state.reset()
            case ("go on",):
                state.go_on()
            case ("lose",):
                state.lose()
            case ("regain",):
                state.regain()
    except EmergencyStopError:
        return False
    return True


class Judged:
    """A stop state and a judge with a memory of its own: since when a stop stands, and whether joints may move."""

    def __init__(self):
        self.state = StopState()
        self.standing = self.pulled = False

    def happen(self, event):
        before = self.state.phase
        taken = happen(self.state, event)
        if event[0] == "press" or (event == ("pull", True) and not self.pulled):
            self.standing = True
        if event[0] == "pull":
            self.pulled = event[1]
        if event == ("reset",) and taken:
            assert before == "latched"
            assert not self.pulled
            self.standing = False
        if event == ("go on",):
            assert taken == (not self.standing), "who lets joints go on learns that a stop stands"
        after = self.state.phase
        assert after == before or (before, after) in CHANGES
        if self.standing:
            assert after in ("braking", "latched"), f"{event} lets the joints move while a stop stands"
        if after == "running" and before == "held":
            assert event == ("go on",)
        assert self.state.stopped == (after == "latched" or (after == "braking" and self.state.demanded))


def test_in_no_order_of_events_anything_moves_between_a_stop_and_its_reset():
    seen = set()

    def explore(judged, depth):
        state = judged.state
        key = (
            state.phase,
            tuple(state.presses.get(s, 0) - state.released.get(s, 0) for s in SOURCES),
            judged.pulled,
            judged.standing,
            depth,
        )
        if depth == 0 or key in seen:
            return
        seen.add(key)
        for event in EVENTS:
            after = deepcopy(judged)
            after.happen(event)
            explore(after, depth - 1)

    explore(Judged(), 8)
    assert len(seen) > 150


@given(st.lists(st.sampled_from(EVENTS), max_size=200))
def test_in_long_random_orders_neither(events):
    judged = Judged()
    for event in events:
        judged.happen(event)


def test_a_wire_that_was_let_go_stays_a_stop_until_the_reset():
    state = StopState()
    state.pull("wire", True)
    state.rested()
    assert state.phase == "latched"
    with pytest.raises(EmergencyStopError, match="at wire is still pulled"):
        state.reset()
    state.pull("wire", False)
    assert state.phase == "latched"
    assert state.stopped
    state.reset()
    assert state.phase == "held"


def test_a_press_that_crosses_a_reset_stands():
    """Two machines keep the state of one rig: a reset of one releases only what it had seen of the other."""
    state = StopState()
    state.press("door")
    seen = dict(state.presses)
    state.rested()
    state.press("door")
    state.release(seen)
    assert state.phase == "latched"
    state.release({"door": 2})
    assert state.phase == "held"


def test_no_reset_of_another_machine_releases_what_is_pulled():
    state = StopState()
    state.pull("wire", True)
    state.rested()
    state.release(state.presses)
    assert state.phase == "latched"


def test_a_count_that_comes_twice_or_late_is_no_press():
    state = StopState()
    state.count("door", 2)
    state.rested()
    state.reset()
    state.go_on()
    for old in (2, 1, 0):
        state.count("door", old)
    assert state.phase == "running"
    assert state.total == 2


def test_what_was_released_before_it_was_pressed_is_not_released():
    state = StopState()
    state.release({"door": 5})
    state.press("door")
    assert state.stopped


def test_joints_that_have_nothing_to_follow_are_held_and_need_no_reset():
    state = StopState()
    state.lose()
    assert not state.stopped
    state.rested()
    assert state.phase == "held"
    state.regain()
    assert state.phase == "held", "at rest they are let go on, not caught up with"
    state.go_on()
    assert state.phase == "running"
