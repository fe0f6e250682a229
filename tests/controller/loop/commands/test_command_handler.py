"""The desk beside its commands: events for who subscribes, heartbeats that are missed, resets that are confirmed."""

import json
import re
import subprocess
import sys
from collections import deque
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from command_strategies import commands
from controller.loop.commands import commanded_run
from controller.loop.commands.command_handler import CommandHandler
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.output_channel import FaultCounter
from controller.loop.stop_requests import StopRequest
from controller.wire.messages.command_table import COMMANDS, RECORDED
from controller.wire.messages.commands import (
    AlignTicks,
    AtTime,
    EmergencyStop,
    GetStatus,
    Heartbeat,
    LoadLibrary,
    Pause,
    Push,
    ReadRegisters,
    Reset,
    RestartServo,
    Resume,
    ScanPorts,
    ServoTorque,
    Subscribe,
    Switch,
    WriteRegister,
    encode,
)
from controller.wire.messages.replies import Accepted, Event, PhaseNow, Refused, Registers, State
from motiondeck.run.session import watch_wire


class Deck:
    """As much of a deck as the desk looks at."""

    def __init__(self):
        self.time, self.events, self.paused, self.motion = 1.5, deque(), False, "walk"
        self.motions, self.tempo, self.settled, self.queue = ["walk"], 1.0, True, []
        self.inputs = self.layered = {}
        self.phase = self.lock_state = None
        self.blend = ()
        self.fell_back, self.playing, self.way = "", "walk", []
        self.commanded_tempo, self.restarts = 1.0, 0

    def pause(self):
        self.paused = True

    def resume(self):
        self.paused = False


class Server:
    """Hands over commands that are put into it, and keeps the replies."""

    def __init__(self, remote=False):
        self.remote, self.commands, self.replies, self.gone = remote, [], [], set()

    def poll(self):
        while self.commands:
            yield self.commands.pop(0)

    def reply(self, receiver, reply):
        self.replies.append((receiver, reply))

    def connected(self, sender):
        return sender not in self.gone


class Desk:
    """A desk with a clock that stands still until it is told otherwise."""

    def __init__(self, remote=False, **more):
        self.deck, self.server, self.stop, self.now = Deck(), Server(remote), StopRequest(), 100.0
        self.desk = CommandHandler(CommandedRun(self.deck, **more), [self.server], now=lambda: self.now)

    def ask(self, message, sender="somebody"):
        """The first reply to a command."""
        self.server.commands.append((message, sender))
        self.server.replies.clear()
        self.desk(self.stop)
        return self.server.replies[0][1]

    def tick(self, seconds=0.0):
        """The events that are told after some time."""
        self.now += seconds
        self.server.replies.clear()
        self.desk(self.stop)
        return [reply for _, reply in self.server.replies if isinstance(reply, Event)]


class Ticks:
    """The clock of a loop, at the tick that it is told."""

    period = 0.01

    def __init__(self, due=100.0):
        self.now = due

    def due(self):
        return self.now

    def align(self, here, there):
        self.asked = here, there


@pytest.fixture
def desk():
    return Desk()


def test_only_who_has_subscribed_is_told_what_happens(desk):
    assert desk.ask(Pause(), "bystander") == Accepted(0)
    assert desk.tick() == []
    desk.ask(Subscribe(), "listener")
    desk.deck.events.append(Event("settled", "jog after 0.50 s", "jog", 1.4))
    desk.desk.notify("fault", "rig: it is gone")
    assert desk.tick() == [Event("settled", "jog after 0.50 s", "jog", 1.4, 3)]
    assert {receiver for receiver, _ in desk.server.replies} == {"listener"}


def test_modes_and_pauses_are_told_whoever_commanded_them_and_numbers_rise(desk):
    desk.ask(Subscribe(), "listener")
    desk.ask(EmergencyStop(), "somebody else")
    told = [reply for receiver, reply in desk.server.replies if receiver == "listener"]
    assert [(event.kind, event.text) for event in told] == [("mode", "emergency stop"), ("paused", "paused")]
    assert [event.number for event in told] == [1, 2]


def test_a_client_that_is_silent_for_longer_than_it_said_pauses_the_deck_once(desk):
    desk.ask(Heartbeat(2.0), "hand")
    desk.ask(Subscribe(), "listener")
    assert desk.tick(1.9) == []
    desk.ask(Resume(), "hand")
    assert desk.tick(1.9) == []
    (lost, paused) = desk.tick(0.2)
    assert (lost.kind, paused.kind, desk.deck.paused) == ("lost", "paused", True)
    desk.ask(Resume(), "listener")
    assert [event.kind for event in desk.tick(100.0)] == []
    assert not desk.deck.paused


def test_a_client_that_was_held_up_hears_events_again_and_is_missed_again(desk):
    """A show's member that has stood still passes on emergency stops of its deck afterwards, as before."""
    desk.ask(Heartbeat(2.0), "hand")
    desk.ask(Subscribe(), "hand")
    for _ in range(2):
        assert [event.kind for event in desk.tick(2.1)] == ["lost", "paused"]
        assert desk.tick(2.1) == []
        desk.ask(Resume(), "hand")
        desk.ask(EmergencyStop(), "somebody")
        told = [reply.text for receiver, reply in desk.server.replies if receiver == "hand"]
        assert told == ["emergency stop", "paused"]
        desk.stop.state.rested()
        desk.ask(Reset())
        desk.ask(Resume(), "hand")


def test_a_client_that_has_gone_is_missed_at_once(desk):
    desk.ask(Heartbeat(50.0), "hand")
    desk.server.gone.add("hand")
    desk.tick()
    assert desk.deck.paused


def test_who_ends_its_heartbeat_may_go(desk):
    desk.ask(Heartbeat(2.0), "hand")
    desk.ask(Heartbeat(0.0), "hand")
    desk.server.gone.add("hand")
    desk.tick(100.0)
    assert not desk.deck.paused


def test_a_subscriber_over_a_network_is_forgotten_when_it_is_silent():
    desk = Desk(remote=True)
    desk.ask(Subscribe(), "listener")
    desk.desk.notify("fault", "one")
    assert len(desk.server.replies) == 2
    desk.tick(61.0)
    desk.desk.notify("fault", "two")
    assert desk.server.replies == []


def test_a_reset_from_another_machine_has_to_be_confirmed_and_each_stop_anew():
    desk = Desk(remote=True)
    for _ in range(2):
        assert isinstance(desk.ask(EmergencyStop()), Accepted)
        desk.stop.state.rested()
        refused = desk.ask(Reset())
        assert isinstance(refused, Refused)
        code = float(re.search(r"give reset (\d{4})$", refused.reason)[1])
        wrong = desk.ask(Reset(code=code + 1.0))
        assert isinstance(wrong, Refused)
        assert desk.stop.emergency
        code = float(re.search(r"give reset (\d{4})$", wrong.reason)[1])
        assert isinstance(desk.ask(Reset(code=code)), Accepted)
        assert not desk.stop.emergency


def test_an_emergency_stop_that_is_sent_again_is_one_press(desk):
    counts = []

    def pressed(number, sender):
        desk.server.commands.append((EmergencyStop(id=number), sender))
        events = desk.tick()
        counts.extend(event.presses for event in events if event.kind == "mode")
        return [event.text for event in events]

    desk.ask(Subscribe(), "listener")
    assert pressed(5, "left") == ["emergency stop", "paused"]
    assert pressed(5, "left") == []
    assert pressed(5, "right") == ["emergency stop"]
    assert pressed(5, "left") == pressed(5, "right") == []
    assert pressed(6, "left") == ["emergency stop"]
    desk.stop.state.rested()
    assert isinstance(desk.ask(Reset()), Accepted)
    desk.tick()
    assert pressed(6, "left") == ["emergency stop"], "it is carried out all the same"
    assert desk.stop.emergency
    assert counts == [1, 2, 3, 4]


def test_a_second_press_takes_the_code_of_a_reset_back():
    desk = Desk(remote=True)
    desk.ask(EmergencyStop())
    desk.stop.state.rested()
    code = float(re.search(r"give reset (\d{4})$", desk.ask(Reset()).reason)[1])
    desk.ask(EmergencyStop(), "who sees somebody near")
    desk.stop.state.rested()
    assert isinstance(desk.ask(Reset(code=code)), Refused)
    assert desk.stop.emergency


def test_a_reset_on_this_machine_needs_no_code(desk):
    desk.ask(EmergencyStop())
    desk.stop.state.rested()
    assert isinstance(desk.ask(Reset()), Accepted)


def test_during_an_emergency_stop_who_wants_to_know_is_told(desk):
    desk.ask(EmergencyStop())
    assert isinstance(desk.ask(Subscribe()), Accepted)
    assert isinstance(desk.ask(Heartbeat(1.0)), Accepted)
    assert isinstance(desk.ask(Switch("jog")), Refused)


class Wired:
    """A wired emergency stop."""

    name, pulled, pulls = "/dev/ttyUSB1", False, 0

    def close(self):
        pass


def test_a_wired_stop_stops_and_while_it_is_pulled_a_reset_is_in_vain(desk, capsys):
    wired = Wired()
    watch = watch_wire(wired, desk.desk)
    watch(desk.stop)
    assert not desk.stop.emergency
    wired.pulled, wired.pulls = True, 1
    watch(desk.stop)
    assert desk.stop.emergency
    assert "/dev/ttyUSB1 was pulled" in capsys.readouterr().err
    desk.stop.state.rested()
    refused = desk.ask(Reset())
    assert isinstance(refused, Refused)
    assert "/dev/ttyUSB1 is still pulled" in refused.reason
    watch(desk.stop)
    assert desk.stop.emergency
    wired.pulled = False
    watch(desk.stop)
    assert desk.stop.emergency, "it is latched"
    assert isinstance(desk.ask(Reset()), Accepted)
    watch(desk.stop)
    assert not desk.stop.emergency
    wired.pulls = 2  # a key that was let go again before anybody looked
    watch(desk.stop)
    assert desk.stop.emergency


def test_each_pull_of_a_wired_stop_is_a_new_emergency_stop(desk):
    """In a show a deck that was reset meanwhile stops again."""
    wired = Wired()
    watch = watch_wire(wired, desk.desk)
    presses = []
    for pulled, pulls in ((True, 1), (True, 1), (False, 1), (True, 2), (True, 2), (False, 3)):
        wired.pulled, wired.pulls = pulled, pulls
        watch(desk.stop)
        presses.append(desk.stop.state.total)
    assert presses == [1, 1, 1, 2, 2, 3]


class NotedServos:
    """Servos that note what is done to them."""

    def __init__(self):
        self.done = []

    def switch(self, joint, *, on):
        self.done.append((joint, on))

    def restart(self, joint):
        self.done.append((joint, "restarted"))


def test_a_servo_can_be_switched_off_in_an_emergency_stop_but_not_on(desk):
    assert isinstance(desk.ask(ServoTorque("knee", "off")), Refused)  # there is no rig
    servos = NotedServos()
    desk = Desk(servos=servos)
    desk.ask(EmergencyStop())
    for message in (ServoTorque("knee", "on"), RestartServo("knee")):
        assert isinstance(desk.ask(message), Refused)
    assert desk.ask(ServoTorque("knee", "off")) == Accepted(0)
    desk.stop.state.rested()
    desk.ask(Reset())
    desk.stop.play()
    desk.ask(RestartServo("knee"))
    assert servos.done == [("knee", False), ("knee", "restarted")]


class LookedAt(NotedServos):
    """Servos whose registers are known after a while."""

    found = None

    def registers(self, joint, write=None):
        self.done.append((joint, write))
        return self

    def __call__(self):
        return self.found


def test_a_look_at_servos_is_answered_twice_to_who_asked(desk):
    assert "play with --rig" in desk.ask(ReadRegisters("knee")).reason
    servos = LookedAt()
    desk = Desk(servos=servos)
    assert desk.ask(ReadRegisters("knee", id=7), "one") == Accepted(7)
    assert desk.ask(WriteRegister("knee", "led", 1, id=9), "other") == Accepted(9)
    assert desk.ask(Pause(id=11), "third") == Accepted(11)
    assert servos.done == [("knee", None), ("knee", ("led", 1))]
    servos.found = Registers("knee", "XM430-W350", [])
    desk.tick()
    both = [(who, reply.id) for who, reply in desk.server.replies if isinstance(reply, Registers)]
    assert both == [("one", 7), ("other", 9)]
    desk.ask(EmergencyStop())
    assert isinstance(desk.ask(ScanPorts()), Refused)
    assert desk.ask(ReadRegisters("knee")) == Accepted(0)


def test_a_look_that_comes_to_nothing_is_refused_after_a_while():
    desk = Desk(servos=LookedAt())
    desk.ask(ReadRegisters("knee", id=7))
    desk.tick(14.0)
    assert not desk.server.replies
    desk.tick(2.0)
    assert desk.server.replies == [("somebody", Refused("the rig has not answered", 7))]


def test_a_simulated_body_is_pushed_in_any_mode_and_nothing_else(desk):
    assert "nothing can be pushed" in desk.ask(Push("left")).reason

    body = Body()
    desk = Desk(body=body)
    desk.ask(EmergencyStop())
    assert desk.ask(Push("left", 0.2)) == Accepted(0)
    assert body.pushed == ("left", 0.2, None)


class Body:
    """A simulated body."""

    fallen = False

    def push_from(self, side, impulse, towards):
        self.pushed = side, impulse, towards
        return impulse or 0.3


def test_a_push_and_a_fall_are_told_on_the_clock_of_the_status():
    body = Body()
    desk = Desk(body=body)
    desk.ask(Subscribe())
    desk.ask(Push("back"))
    (pushed,) = (reply for _, reply in desk.server.replies if isinstance(reply, Event))
    assert (pushed.kind, pushed.text, pushed.at) == ("push", "pushed from the back with 0.3 N s", desk.deck.time)
    body.fallen = True
    assert [event.kind for event in desk.tick()] == ["fell"]
    assert desk.tick() == []
    state = desk.ask(GetStatus())
    assert (state.fallen, state.at) == (True, desk.deck.time)
    body.fallen = False
    assert [event.kind for event in desk.tick()] == ["stands"]
    assert not desk.ask(GetStatus()).fallen


def test_another_library_ends_the_run_where_it_can_be_started_again(desk, tmp_path):
    (tmp_path / "mine.safetensors").write_bytes(b"")
    mine = LoadLibrary(str(tmp_path / "mine.safetensors"), "swing")
    assert "takes no other library" in desk.ask(mine).reason
    assert "this machine only" in Desk(remote=True, restarts=True).ask(mine).reason
    desk = Desk(restarts=True)
    assert "no such file" in desk.ask(LoadLibrary("gone.safetensors", "swing")).reason
    assert not desk.stop
    assert desk.ask(mine) == Accepted(0)
    assert (bool(desk.stop), desk.stop.then) == (True, (mine.library, "swing"))


def test_every_command_that_changes_something_is_recorded():
    asks = {"status", "phase", "heartbeat", "align", "at", "subscribe", "registers"}
    assert {row.word for row in COMMANDS} - asks == set(RECORDED.values())


def test_ticks_are_aligned_on_a_deck_in_real_time_by_programs_of_its_machine():
    ticks = Ticks()
    assert Desk(ticks=ticks).ask(AlignTicks(2.5, 7.0)) == Accepted(0)
    assert ticks.asked == (2_500_000_000, 7_000_000_000)
    assert isinstance(Desk().ask(AlignTicks(2.5, 7.0)), Refused)
    assert isinstance(Desk(remote=True, ticks=ticks).ask(AlignTicks(2.5, 7.0)), Refused)


def test_a_command_for_a_time_is_carried_out_in_the_tick_nearest_to_it():
    ticks = Ticks()
    desk = Desk(ticks=ticks)
    assert desk.ask(AtTime(100.017, Pause(), id=3)) == Accepted(3)
    for due in (100.0, 100.01):
        ticks.now = due
        desk.tick()
        assert not desk.deck.paused
    ticks.now = 100.02
    desk.tick()
    assert desk.deck.paused
    desk.ask(AtTime(100.015, Resume()))
    assert not desk.deck.paused  # that time has passed


def test_commands_for_one_time_keep_their_order_and_are_refused_where_they_cannot_be_carried_out():
    ticks = Ticks()
    desk = Desk(ticks=ticks)
    for number, say in enumerate((Pause(), Resume(), Push("left"))):
        desk.ask(AtTime(100.02, say, id=number))
    ticks.now = 100.02
    desk.tick()
    assert not desk.deck.paused
    ((sender, refused),) = desk.server.replies
    assert (sender, refused.id) == ("somebody", 2)
    assert "nothing can be pushed" in refused.reason


def test_an_emergency_stop_and_a_sender_that_leaves_end_commands_for_a_time():
    ticks = Ticks()
    desk = Desk(ticks=ticks)
    desk.ask(AtTime(100.02, Resume()))
    desk.ask(EmergencyStop())
    assert isinstance(desk.ask(AtTime(100.02, Resume())), Refused)
    desk.stop.state.rested()
    desk.ask(Reset())
    desk.ask(AtTime(100.03, Pause()), "who leaves")
    desk.server.gone.add("who leaves")
    desk.deck.paused = True
    ticks.now = 100.02
    desk.tick()
    assert desk.deck.paused
    desk.deck.paused, ticks.now = False, 100.03
    desk.tick()
    assert not desk.deck.paused


def test_commands_for_a_time_are_bounded_and_for_programs_of_this_machine():
    ticks = Ticks()
    desk = Desk(ticks=ticks)
    assert "at most 60 s ahead" in desk.ask(AtTime(161.0, Pause())).reason
    for _ in range(64):
        assert isinstance(desk.ask(AtTime(110.0, Pause())), Accepted)
    assert "64 commands wait" in desk.ask(AtTime(110.0, Pause())).reason
    for other in (Desk(), Desk(remote=True, ticks=ticks)):
        assert "programs of this machine" in other.ask(AtTime(100.0, Pause())).reason


class FailingParts(Deck):
    """A deck, servos, a body and a clock of which each command raises an error."""

    period, fallen, phase_rate, phase_at = 0.01, False, None, None

    def __init__(self, error):
        super().__init__()
        self.error = error

    def fail(self, *_, **__):
        raise self.error

    switch = enqueue = blend_in = set_tempo = set_input = gaze = layer = lock = unlock = follow = beat = jump = fail
    step_on = resume = restart = registers = scan = push_from = due = align = fail


ERRORS = st.sampled_from(
    [OSError(36, "File name too long", "\udcff"), ValueError("embedded null byte"), KeyError("walk"), RecursionError()]
)
PATHS = st.one_of(
    st.just("a" * 300),
    st.just("a\0b"),
    st.text(st.characters(exclude_categories=["Cs"], exclude_characters=" "), min_size=1, max_size=400),
)


@given(st.lists(commands(PATHS), max_size=30), ERRORS, st.booleans())
def test_whatever_a_command_raises_refuses_that_command_only(given, error, remote):
    parts = FailingParts(error)
    server, stop, counter = Server(remote), StopRequest(), FaultCounter()
    desk = CommandHandler(CommandedRun(parts, servos=parts, body=parts, restarts=True, ticks=parts), [server])
    for message in given:
        server.commands.append((message, "somebody"))
        counter.call(desk, stop)
        (reply,) = [reply for _, reply in server.replies if not isinstance(reply, Event)]
        assert isinstance(reply, Accepted | Refused | State | PhaseNow)
        assert encode(reply)
        server.replies.clear()
    assert counter.faults == 0


def test_names_that_are_no_paths_do_not_make_the_deck_deaf():
    desk = Desk(restarts=True)
    for _ in range(25):
        assert "File name too long" in desk.ask(LoadLibrary("a" * 300, "walk")).reason
        assert "no such file" in desk.ask(LoadLibrary("a\0b", "walk")).reason
    assert isinstance(desk.ask(GetStatus()), State)


def test_a_look_that_fails_is_answered_and_forgotten():
    class FailingLook:
        def __call__(self):
            raise OSError("the port is gone")

    class Servos:
        def scan(self):
            return FailingLook()

    desk = Desk(servos=Servos())
    desk.ask(ScanPorts(id=4))
    assert [reply for _, reply in desk.server.replies][1:] == [Refused("OSError: the port is gone", 4)]
    desk.tick()
    assert desk.server.replies == []


@pytest.mark.thorough
def test_a_command_without_a_handler_is_a_type_error(tmp_path):
    path = Path(commanded_run.__file__)
    complete = path.read_text()
    lacking = complete.replace("            case commands.Unlock():\n                self._deck.unlock()\n", "")
    (tmp_path / "complete.py").write_text(complete)
    (tmp_path / "lacking.py").write_text(lacking)
    (tmp_path / "pyrightconfig.json").write_text(json.dumps({"extraPaths": [str(path.parents[3])]}))
    checked = subprocess.run(
        [sys.executable, "-m", "pyright", "--outputjson", "--pythonpath", sys.executable, "-p", tmp_path],
        capture_output=True,
        check=False,
    )
    (error,) = json.loads(checked.stdout)["generalDiagnostics"]
    assert Path(error["file"]).name == "lacking.py"
    assert '"Unlock" is not assignable to type "Never"' in " ".join(error["message"].split()).replace("Type ", "")
