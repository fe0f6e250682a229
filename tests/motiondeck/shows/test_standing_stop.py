"""A stop of a show is a state: whatever is cut, restarted or pressed again, a deck is still until it is reset there."""

from contextlib import closing

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motiondeck.shows.known_stops import MOST_SENT, KnownStops, StopMemory
from motiondeck.shows.messages import EmergencyStopAll, Time, encode, read
from show_house import NAMES, House


@pytest.fixture
def house():
    with closing(House()) as house:
        house.conduct()
        for name in NAMES:
            house.start(name)
        assert house.moving == {*NAMES}
        yield house


@pytest.mark.parametrize("lost", ["go on", "hold"])
def test_a_deck_that_was_cut_is_stopped_when_its_link_is_back(lost):
    with closing(House()) as house:
        house.conduct(if_lost=lost)
        for name in NAMES:
            house.start(name)
        house.cut("right")
        house.run(4.0)
        house.press("left")
        assert house.moving == ({"right"} if lost == "go on" else set())
        house.cut("right", cut=False)
        assert house.moving == set()
        assert lost == "go on" or house.moved == set()
        house.reset("right")
        assert house.moving == {"right"}, "the same stop does not stop it again"


def test_a_deck_that_is_restarted_does_not_move_while_a_stop_stands(house):
    house.press("left")
    house.reset("middle")
    for name in NAMES:
        house.start(name)
        assert name not in house.moved


def test_a_stop_stands_without_a_conductor(house):
    house.conductor.close()
    house.conductor = None
    house.cut("right")
    house.press("left")
    house.start("middle")
    assert "middle" not in house.moved
    house.cut("right", cut=False)
    assert house.moving == set()


@pytest.mark.parametrize("conducted", [True, False])
def test_a_deck_that_was_not_reset_is_stopped_when_it_starts_again_without_a_link(house, conducted):
    house.press("left")
    if not conducted:
        house.conductor.close()
        house.conductor = None
    house.cut("right")
    house.start("right", cut=True)
    assert "right" not in house.moved | house.moving
    house.reset("right")
    house.start("right", cut=True)
    assert "right" in house.moving, "it was reset before it ended"


def test_a_stop_goes_on_at_once_to_a_deck_that_only_another_one_is_linked_to(house, monkeypatch):
    monkeypatch.setattr("motiondeck.shows.member.ASKS_EVERY", 60.0)  # only then is it repeated
    house.run(3.0)
    house.network.apart = [{"left", "right"}, *({"conductor", name} for name in ("left", "right"))]
    house.press("left", 0.1)
    assert house.decks["right"].stop.emergency


def test_a_deck_repeats_all_stops_that_it_was_not_reset_from(house):
    house.conductor.close()
    house.conductor = None
    house.network.apart = [{"left", "middle"}, {"left", "right"}]
    house.press("left")
    house.press("middle")
    house.reset("right")
    house.network.apart, house.network.deaf = [{"left", "right"}], [("middle", "left")]
    house.run()
    assert not house.decks["right"].stop.emergency
    house.network.apart, house.network.deaf = [], []
    house.run()
    assert house.decks["right"].stop.emergency


@pytest.mark.parametrize("first", ["conductor", "left"])
def test_stops_that_were_given_apart_reach_all_when_they_meet(house, first):
    """The conductor, or a deck, is cut and stopped, and has not heard of the other stop."""
    house.network.apart = [{first, name} for name in (*NAMES, "conductor") if name != first]
    house.press("middle")
    house.reset("right")
    if first == "conductor":
        house.conductor.stop()
        house.run()
    else:
        house.press("left")
    assert "right" in house.moving
    # The deck that holds the other stop comes back first.
    house.network.apart = [{first, name} for name in NAMES if name not in (first, "middle")]
    house.run()
    house.network.apart = []
    house.run()
    assert house.moving == set()


def test_a_deck_that_waits_for_a_conductor_does_not_go_on_before_that_one_knows_the_stop():
    with closing(House()) as house:
        house.conduct(if_lost="hold")
        for name in NAMES:
            house.start(name)
        house.run(2.0)
        house.conductor.close()
        house.conductor = None
        house.run(4.0)
        house.cut("right")
        house.press("left")
        house.reset("left")
        house.conduct(if_lost="hold")
        house.network.apart = [{name, "right"} for name in ("left", "middle")]
        house.network.apart += [{name, "conductor"} for name in ("left", "middle")]
        house.notes.clear()
        house.cut("right", cut=False, seconds=0.0)
        while "the conductor is back" not in house.notes:
            house.run(0.02)
            assert "right" not in house.moved
        house.network.apart = []
        house.run()
        assert "right" not in house.moved | house.moving
        house.reset("right")
        assert "right" in house.moving


def test_no_deck_counts_as_reset_before_it_was_reset(house):
    for _ in range(20):
        house.conductor.stop()
        for _ in range(7):
            house.run(0.02)
            assert "reset" not in house.stops().values()
        for name in NAMES:
            house.reset(name, 0.08)
        house.run(0.5)
        house.conductor.go()


def test_the_conductor_says_within_half_a_second_which_decks_the_stop_has_reached(house):
    def said(seconds=None):
        house.notes.clear()
        if seconds is None:
            house.run()
        else:
            house.press("left", seconds)
        return [note for note in house.notes if note.startswith("the emergency stop has")]

    assert said(0.2) == ["the emergency stop has reached left, middle, right"]
    house.network.apart = [{"right", name} for name in (*NAMES, "conductor") if name != "right"]
    assert said(0.45) == ["the emergency stop has not reached right"]
    house.network.apart = []
    assert said() == ["the emergency stop has reached left, middle, right"]
    house.conductor.show.decks.append("far")
    assert said(0.45) == ["the emergency stop has not reached far (not here)"]


def test_a_second_press_is_a_new_stop(house):
    house.press("left")
    house.reset("middle")
    house.reset("right")
    assert house.moving == {"middle", "right"}
    house.press("left")
    assert house.moving == set()


def test_a_press_in_the_tick_of_a_stop_of_the_show_is_a_stop_of_its_own(house):
    house.conductor.stop()
    house.run(0.02)  # the members have sent it to their decks
    house.press("left")
    house.press("left")
    stops = [note for note in house.notes if note.startswith("emergency stop by left; reset")]
    assert len(stops) == 2


def test_it_is_known_who_holds_the_stop_and_who_was_reset(house):
    assert house.stops() == dict.fromkeys(NAMES, "")
    house.cut("right")
    house.press("left")
    house.reset("middle")
    assert house.stops() == {"left": "holds", "middle": "reset", "right": "not reached"}
    assert house.conductor.go() == "first reset the emergency stop at: left, right"
    house.cut("right", cut=False)
    house.reset("left")
    house.reset("right")
    assert set(house.stops().values()) == {"reset"}
    assert house.conductor.go().startswith("the emergency stop is over")


def test_a_new_conductor_takes_over_the_stop_and_what_is_over_stays_over(house):
    house.press("left")
    for name in NAMES:
        house.reset(name)
    for over in (False, True):
        house.conductor.close()
        house.conduct()
        house.run()
        assert house.conductor.stopped_by == ("" if over else "left")
        assert house.moving == {*NAMES}
        if not over:
            house.conductor.go()
            house.run()


def test_a_deck_that_was_cut_through_a_whole_stop_is_stopped_and_one_that_starts_later_is_not(house):
    house.conductor.close()
    house.conduct(if_lost="go on")
    house.run()
    house.cut("right")
    house.press("left")
    house.reset("left")
    house.reset("middle")
    house.conductor.decks["right"].here = False
    assert house.conductor.go().startswith("the emergency stop is over")
    house.start("middle")
    assert house.moving == {"left", "middle", "right"}
    house.cut("right", cut=False)
    assert house.moving == {"left", "middle"}


def stops(count):
    return [EmergencyStopAll("left", str(number)) for number in range(count)]


def test_what_is_over_stays_over_and_many_presses_leave_the_latest():
    known = KnownStops()
    assert [known.add(stop) for stop in stops(3)] == [True] * 3
    assert not known.add(msgspec.structs.replace(stops(3)[1], over=True))
    assert not known.add(stops(3)[1])
    assert [stop.id for stop in known.standing] == ["0", "2"]
    for stop in stops(1000):
        known.add(stop)
    assert known.latest == stops(1000)[-MOST_SENT:]
    assert known.latest[-len(known.standing) :] == known.standing
    known.end()
    assert known.standing == []
    assert stops(1000)[-1] in known
    known.add(EmergencyStopAll("right", "stands"))
    for stop in stops(2000)[-100:]:
        known.add(msgspec.structs.replace(stop, over=True))
    assert [stop.id for stop in known.latest][-1] == "stands", "as long as others need it to know that it is reset"


def test_a_memory_that_is_damaged_is_empty(tmp_path):
    memory = StopMemory(tmp_path / "left.stops")
    assert memory.read() == []
    memory.write(stops(2))
    assert memory.read() == stops(2)
    (tmp_path / "left.stops").write_bytes(b"[{")
    assert memory.read() == []
    memory.write([])
    assert not (tmp_path / "left.stops").exists()


def test_a_conductor_of_before_the_standing_stop_is_understood():
    class OlderTime(msgspec.Struct):
        run: str
        seconds: float
        lost: str
        after: float

    assert read(encode(OlderTime("run", 1.0, "hold", 3.0)), Time) == Time("run", 1.0, "hold", 3.0)
    newer = read(encode(Time("run", 1.0, "hold", 3.0)), OlderTime)
    assert newer == OlderTime("run", 1.0, "hold", 3.0)


class Expected:
    """Who has to be still, from what was done."""

    def __init__(self):
        self.stop, self.over = 0, True
        self.known = dict.fromkeys(NAMES, 0)
        self.still, self.cut, self.own, self.new = set(), set(), set(), set()

    def spread(self):
        """What the connected decks have heard after a while."""
        for name in {*NAMES} - self.cut:
            if self.own & {name}:  # pressed while it was cut
                self.own.discard(name)
                self.stop, self.over = self.stop + 1, False
                self.known[name] = self.stop
        for name in {*NAMES} - self.cut:
            if self.known[name] != self.stop and not (self.over and name in self.new):
                self.still.add(name)
            self.known[name] = self.stop
            self.new.discard(name)

    def press(self, name):
        self.still.add(name)
        self.own.add(name)

    def conductor_stop(self):
        self.stop, self.over = self.stop + 1, False

    def reset(self, name):
        self.still.discard(name)
        self.own.discard(name)

    def restart(self, name):
        if name not in self.still:  # else it remembers
            self.reset(name)
            self.known[name] = -1
            self.new.add(name)


WHAT = st.sampled_from(["press", "press", "reset", "reset", "cut", "heal", "restart"])
DONE = st.tuples(WHAT, st.sampled_from(NAMES))
SHOW = st.tuples(st.sampled_from(["stop", "go"]), st.just(""))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.one_of(DONE, DONE, SHOW), min_size=3, max_size=14), st.sampled_from(["go on", "hold"]))
def test_nothing_moves_after_a_stop_until_it_is_reset_there(schedule, lost):
    with closing(House()) as house:
        house.conduct(if_lost=lost)
        for name in NAMES:
            house.start(name)
        expected = Expected()
        for what, name in schedule:
            still_before = set(expected.still)
            carry_out(house, expected, what, name)
            expected.spread()
            assert not expected.still & house.moving, (what, name)
            assert not still_before & expected.still & house.moved, (what, name)
            if what == "reset" and name not in expected.still and not (lost == "hold" and name in expected.cut):
                assert name in house.moving, "no stop that it was reset from stops it again"
            if what == "restart" and name in expected.still:
                assert name not in house.moved, "not even before it is stopped"


def carry_out(house, expected, what, name):
    """Does one thing, and notes what has to come of it."""
    match what:
        case "press":
            expected.press(name)
            house.press(name)
        case "reset":
            expected.reset(name)
            house.reset(name)
        case "cut" | "heal":
            expected.cut = expected.cut | {name} if what == "cut" else expected.cut - {name}
            house.cut(name, cut=what == "cut")
        case "restart":
            expected.restart(name)
            house.start(name, cut=name in expected.cut)
        case "stop":
            expected.conductor_stop()
            house.conductor.stop()
            house.run()
        case _:
            for deck in house.conductor.decks.values():
                deck.here = not house.decks[deck.name].link.cut
            if house.conductor.go().startswith("the emergency stop is over"):
                expected.over = True
            house.run()
