"""Two decks and a conductor over loopback: found, started together, kept in step, stopped together."""

import threading
import time
from contextlib import ExitStack, closing

import pytest

import synthetic
from controller.deck.deck import Deck
from controller.deck.locks.phase_lock import wrapped
from controller.loop.commands.command_handler import CommandHandler
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.stop_requests import StopRequest
from controller.wire.command_socket import CommandClient, CommandServer
from controller.wire.leader_link import LeaderLink
from motiondeck.shows.conductor import Conductor
from motiondeck.shows.link import Link
from motiondeck.shows.member import Member
from motiondeck.shows.membership import on_this_machine
from motiondeck.shows.messages import About, EmergencyStopAll, encode
from motiondeck.shows.show_file import Show, ShowCue
from motiondeck.shows.show_state import show_state
from waiting import until

pytest.importorskip("zenoh")

DT = 0.005
ROUND = 0.9


class Ticks:
    """The clock of a loop whose ticks stay where they are."""

    period = DT

    def __init__(self, due):
        self.due = due

    def align(self, here, there):
        pass


class Machine(threading.Thread):
    """A machine with a deck in real time and its member, whose clock is not that of the others."""

    def __init__(self, name, offset=0.0, drift=0.0):
        super().__init__(daemon=True)
        self.name, self.told, self.began = name, [], {}
        self._offset, self._drift, self._due = offset, drift, time.monotonic()
        self.left, self.open = threading.Event(), ExitStack()
        server = self.open.enter_context(closing(CommandServer(0)))
        leader = self.open.enter_context(closing(CommandServer(0)))
        self.deck = Deck(synthetic.small_phase_library(), lambda pose: pose.rotation.ravel(), "march")
        self.deck.leader = self.open.enter_context(closing(LeaderLink.to(str(leader.port))))
        self.deck.due = lambda: self._by_own_clock(self._due)
        ticks = Ticks(self.deck.due)
        self.stop, self.desk = (
            StopRequest(),
            CommandHandler(CommandedRun(self.deck, ticks=ticks), [server], note=self._note),
        )
        client = self.open.enter_context(closing(CommandClient(server.port)))
        about = About("dummy", "small", 1.0 / DT, dict.fromkeys(self.deck.motions, ROUND))
        link = Link(on_this_machine("gala", name))
        self.member = Member(name, about, link, client, leader, self.told.append, self.now)
        self.open.callback(self.member.close)

    def now(self):
        return self._by_own_clock(time.monotonic())

    def _by_own_clock(self, seconds):
        return self._offset + (1.0 + self._drift) * seconds

    def _note(self, message, reply):
        self.began[type(message).__name__] = self._due  # the tick, by the clock that all machines have

    def run(self):
        threading.Thread(target=self._play, daemon=True).start()
        while not self.left.is_set():
            self.member.step(0.01)

    def _play(self):
        while not self.left.is_set():
            self.desk(self.stop)
            self.deck.update(DT)
            self._due += DT
            time.sleep(max(self._due - time.monotonic(), 0.0))

    def end(self):
        self.left.set()
        self.join()
        self.open.close()


class Theatre:
    def __init__(self, monkeypatch, folder):
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
        self.machines, self.told, self.conductor = {}, [], None

    def deck(self, name, **clock):
        machine = self.machines[name] = Machine(name, **clock)
        machine.start()
        return machine

    def conduct(self, **show):
        show = Show("gala", **show)
        self.conductor = Conductor(show, Link(on_this_machine("gala", "conductor")), self.told.append)

    def until(self, true):
        def stepped():
            if self.conductor is not None:
                self.conductor.step()
            return true()

        until(stepped, f"what should follow: {self.told}")

    def close(self):
        if self.conductor is not None:
            self.conductor.close()
        for machine in self.machines.values():
            machine.end()


@pytest.fixture
def theatre(monkeypatch, tmp_path_factory):
    opened = Theatre(monkeypatch, tmp_path_factory.mktemp("run"))
    yield opened
    opened.close()


def aligned_cycles(*machines):
    locks = [machine.deck.lock_state for machine in machines]
    if any(lock is None or lock.state != "locked" for lock in locks):
        return False
    phases = [machine.deck.phase for machine in machines]
    return max(abs(wrapped(phase - phases[0])) for phase in phases) * ROUND < 0.03


def test_two_decks_start_together_keep_step_and_stop_together(theatre):
    left, right = theatre.deck("left", offset=500.0, drift=1e-4), theatre.deck("right", offset=-70.0, drift=-1e-4)
    theatre.conduct(cues=[ShowCue(say="switch march", when="here", in_step=True)], decks=["left", "right"], lead=0.1)
    theatre.until(lambda: aligned_cycles(left, right))

    def together():
        begun = [machine.began.pop("Switch", None) for machine in (left, right)]
        if None in begun:  # it is given again, as a member that gets no core hears of it too late
            theatre.conductor.command(["all"], "switch march")
            theatre.until(lambda: "Switch" in left.began and "Switch" in right.began)
            return together()
        return abs(begun[0] - begun[1]) < 0.02  # two ticks, and what the clocks are known to

    theatre.until(together)
    assert "left is here: dummy, small" in theatre.told
    state = show_state(theatre.conductor)
    assert (state.present, state.upcoming, state.stopped_by) == (0, None, "")
    assert [(deck.name, deck.here, deck.health.motion) for deck in state.decks] == [
        ("left", True, "march"),
        ("right", True, "march"),
    ]

    def clocks_known():
        ahead = [deck.health.clock.offset_s for deck in show_state(theatre.conductor).decks]
        return ahead[1] - ahead[0] == pytest.approx(570.0 + 2e-4 * time.monotonic(), abs=0.03)

    theatre.until(clocks_known)

    theatre.deck("late", offset=3.0)
    theatre.conductor.command(["all"], "tempo 1")  # `all` are left and right
    with pytest.raises(Exception, match="unknown motion"):
        theatre.conductor.command(["left"], "switch wlk")
    late_known = lambda: (view := theatre.conductor.decks.get("late")) and view.health and view.health.clock  # noqa: E731
    theatre.until(late_known)

    theatre.conductor.stop()
    assert show_state(theatre.conductor).stopped_by == "conductor"
    machines = theatre.machines.values()
    theatre.until(lambda: all(machine.stop.emergency for machine in machines))
    assert "emergency stop by the conductor" in left.told
    assert "first reset the emergency stop" in theatre.conductor.go()
    with pytest.raises(Exception, match="the emergency stop is on; reset it at each deck, then: go"):
        theatre.conductor.command(["all"], "switch march")


@pytest.mark.thorough
def test_a_deck_that_joins_late_joins_in_step(theatre):
    left = theatre.deck("left")
    theatre.conduct(cues=[ShowCue(say="switch march", when="here", in_step=True)], lead=0.1)
    theatre.until(lambda: aligned_cycles(left))
    late = theatre.deck("late", offset=3.0)
    theatre.until(lambda: aligned_cycles(left, late))
    assert "late joins" in theatre.told


@pytest.mark.thorough
def test_it_is_told_who_is_missing_and_who_is_left_out(theatre, monkeypatch):
    monkeypatch.setattr("motiondeck.shows.conductor.REPORTED_AFTER", 0.05)
    left = theatre.deck("left")
    cues = [
        ShowCue(say="switch march", name="early", at=0.0, to=["left", "right"]),
        ShowCue(say="pause", name="late", when="here"),
    ]
    theatre.conduct(cues=cues, decks=["left", "right"], lead=0.05)
    theatre.until(lambda: "late waits: right is not here" in theatre.told)
    assert any(text.startswith("early: ") and "not here: " in text and "right" in text for text in theatre.told)
    theatre.until(lambda: "left" in theatre.conductor.decks)
    assert [deck.here for deck in show_state(theatre.conductor).decks] == [True, False]
    assert theatre.conductor.command(["all"], "tempo 1.2") == "left (not here: right): tempo 1.2"
    for names, problem in (("right", "not here: right"), ("lft", "unknown deck 'lft'. Did you mean left?")):
        with pytest.raises(Exception, match=problem):
            theatre.conductor.command([names], "tempo 1.2")
    right = theatre.deck("right")
    theatre.until(lambda: left.deck.paused)
    theatre.until(lambda: right.deck.commanded_tempo == 1.2)


def test_a_stop_of_one_deck_stops_all_without_a_conductor(theatre):
    left, right = theatre.deck("left"), theatre.deck("right")
    left.stop.state.press("command")
    theatre.until(lambda: right.stop.emergency)


def test_a_deck_that_loses_the_conductor_holds_and_comes_back(theatre):
    left = theatre.deck("left")
    theatre.conduct(cues=[ShowCue(say="switch march", when="here")], lead=0.1, lost_after=1.0)
    theatre.until(lambda: "Switch" in left.began)

    def plays():  # and has told its member so
        known = theatre.conductor.decks.get("left")
        return known and known.health and (known.health.mode, known.health.paused) == ("playing", False)

    theatre.until(plays)
    theatre.conductor.close()
    theatre.conductor = None
    theatre.until(lambda: left.deck.paused)
    theatre.conduct(lost_after=1.0)
    theatre.until(lambda: not left.deck.paused)


def test_what_no_show_may_say_is_not_carried_out(theatre):
    left = theatre.deck("left")
    theatre.conduct(lead=0.05)
    theatre.until(lambda: "left" in theatre.conductor.decks and theatre.conductor.decks["left"].health)
    left.stop.state.press("command")
    with pytest.raises(Exception, match="not for a show"):
        theatre.conductor.command(["left"], "reset")
    link = Link(on_this_machine("gala", "other", listens=False))
    with closing(link):

        def heard():
            link.publish("stop", b"nonsense")
            link.publish("cue", b'{"run": 3}')
            link.publish("stop", encode(EmergencyStopAll("other", "1")))
            return any("emergency stop by other" in text for text in theatre.told)

        theatre.until(heard)  # a new link does not wait for those that it is to reach
    assert left.stop.emergency


def test_a_hold_says_what_waits_and_a_refusal_says_whose_it_is(theatre):
    theatre.deck("left")
    cues = [ShowCue(say=["switch march", "tempo 1"], at=3600.0)]
    theatre.conduct(cues=cues, lead=0.05)
    theatre.until(lambda: "left" in theatre.conductor.decks and theatre.conductor.decks["left"].health)
    assert theatre.conductor.go() == "the show does not wait for go; to give cue 1 at once: hold, then go"
    assert theatre.conductor.hold() == theatre.conductor.hold() == "waits for go: cue 1"
    theatre.until(lambda: theatre.conductor.decks["left"].health.clock)
    for _ in range(2):  # a refusal in the same words is another one
        theatre.told.clear()
        theatre.conductor.command(["left"], "input speed 1")
        theatre.until(lambda: any(text.startswith("left: input speed 1: ") for text in theatre.told))
    assert theatre.conductor.go() == "goes on"
    theatre.until(lambda: theatre.conductor.over)
    assert theatre.conductor.go() == theatre.conductor.hold() == "all cues have been given: type commands to go on"
    assert not any("[" in text for text in theatre.told)
