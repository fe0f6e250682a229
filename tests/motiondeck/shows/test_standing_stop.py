"""A stop of a show is a state: whatever is cut, restarted or pressed again, a deck is still until it is reset there."""

from contextlib import ExitStack, closing
from fnmatch import fnmatch
from functools import cache

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import synthetic
from controller.deck.deck import Deck
from controller.loop.commands.command_handler import CommandHandler
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.stop_requests import StopRequest
from controller.wire.command_socket import CommandClient, CommandServer
from controller.wire.messages.commands import EmergencyStop, GetPhase, Reset, Resume
from controller.wire.messages.replies import Accepted, PhaseNow
from motiondeck.shows.conductor import Conductor
from motiondeck.shows.member import Member
from motiondeck.shows.messages import About, Time, encode, read
from motiondeck.shows.show_file import Show

NAMES = ["left", "middle", "right"]
TICK = 0.02
SETTLES = 0.7  # s; questions are at most 0.35 s apart

library = cache(synthetic.small_phase_library)


class Network:
    """Links in this process, of which any can be cut from all others."""

    def __init__(self):
        self.links = {}

    def others(self, name):
        here = self.links[name]
        return [link for link in self.links.values() if link is not here and not here.cut and not link.cut]


class Link:
    def __init__(self, network, name, *, cut=False):
        self.network, self.name, self.cut = network, name, cut
        self.subscribed, self.answers, self.announced, self.watching = [], {}, [], []
        network.links[name] = self

    def subscribe(self, keys, received):
        self.subscribed.append((keys, received))

    def publish(self, key, data):
        for link in self.network.others(self.name):
            for keys, received in link.subscribed:
                if fnmatch(key, keys):
                    received(key, data)

    def answer(self, key, answer):
        self.answers[key] = answer

    def ask(self, keys, received, patience=1.0):
        for link in self.network.others(self.name):
            for key, answer in link.answers.items():
                if fnmatch(key, keys):
                    received(key, answer())

    def announce(self, key):
        self.announced.append(key)
        for link in self.network.links.values():
            for keys, seen in link.watching:
                if fnmatch(key, keys):
                    seen(key, True)

    def watch(self, keys, seen):
        self.watching.append((keys, seen))
        for link in self.network.others(self.name):
            for key in link.announced:
                if fnmatch(key, keys):
                    seen(key, True)

    def close(self):
        if self.network.links.get(self.name) is self:
            del self.network.links[self.name]


class DeckOfShow:
    """A deck with its sockets and its member."""

    def __init__(self, house, name, *, cut=False):
        self.open, self.ran = ExitStack(), False
        server = self.open.enter_context(closing(CommandServer(0)))
        leader = self.open.enter_context(closing(CommandServer(0)))
        deck = Deck(library(), lambda pose: pose.rotation.ravel(), "march")
        self.stop, self.handler, self.deck = StopRequest(), CommandHandler(CommandedRun(deck), [server]), deck
        client = self.open.enter_context(closing(CommandClient(server.port)))
        self.link, about = Link(house.network, name, cut=cut), About("dummy", "small", 50.0, {"march": 0.9})
        now = lambda: house.time  # noqa: E731
        self.member = Member(name, about, self.link, client, leader, house.notes.append, now)
        self.open.callback(self.member.close)
        asking = self.open.enter_context(closing(CommandClient(leader.port)))
        while True:  # as `ShowMember.leader` waits
            asking.post(GetPhase())
            self.member.step(0.0)
            if isinstance(asking.receive(1.0), PhaseNow):
                break
            house.run(TICK)
        self.ran = True

    def tick(self):
        self.handler(self.stop)
        self.stop.state.rested()

    @property
    def moves(self):
        return self.stop.mode == "playing" and not self.deck.paused


class House:
    """A show on a clock of its own."""

    def __init__(self):
        self.time, self.notes, self.network = 1000.0, [], Network()
        self.decks, self.conductor, self.moved = {}, None, set()

    def conduct(self, **show):
        link = Link(self.network, "conductor")
        self.conductor = Conductor(Show("gala", **show), link, self.notes.append, now=lambda: self.time)

    def start(self, name, *, cut=False):
        self.kill(name)
        self.decks[name] = DeckOfShow(self, name, cut=cut)
        self.run(SETTLES)

    def kill(self, name):
        if name in self.decks:
            self.decks.pop(name).open.close()

    def run(self, seconds=SETTLES):
        """Runs the show; `moved` are the decks that moved meanwhile."""
        self.moved = set()
        for _ in range(round(seconds / TICK)):
            self.time += TICK
            for name, deck in self.decks.items():
                deck.tick()
                self.moved |= {name} if deck.moves else set()
                deck.member.step(0.0)
            if self.conductor is not None:
                self.conductor.step()

    def press(self, name):
        deck = self.decks[name]
        assert isinstance(deck.handler.carry_out(EmergencyStop(), deck.stop), Accepted)
        self.run()

    def reset(self, name):
        deck = self.decks[name]
        if deck.stop.emergency:
            assert isinstance(deck.handler.carry_out(Reset(), deck.stop), Accepted)
        deck.handler.carry_out(Resume(), deck.stop)
        self.run()

    def cut(self, name, *, cut=True):
        self.decks[name].link.cut = cut
        self.run()

    @property
    def moving(self):
        return {name for name, deck in self.decks.items() if deck.moves}

    def stops(self):
        return {name: self.conductor.stop_at(self.conductor.decks[name]) for name in self.decks}

    def close(self):
        for name in [*self.decks]:
            self.kill(name)
        if self.conductor is not None:
            self.conductor.close()


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


def test_a_second_press_is_a_new_stop(house):
    house.press("left")
    house.reset("middle")
    house.reset("right")
    assert house.moving == {"middle", "right"}
    house.press("left")
    assert house.moving == set()


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
