import socket
import subprocess
import sys
import threading
from collections import deque
from contextlib import closing
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.simulated_time import VirtualClock
from controller.deck.interfaces import JointLimits
from controller.loop.commands.command_handler import CommandHandler
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.commands.snapshots import SnapshotSource
from controller.loop.loop import run
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.loop.stop_requests import StopRequest
from controller.motion.skeleton import Pose
from controller.wire.command_socket import CommandClient, CommandServer, SocketError
from controller.wire.local_transport import command_folder
from controller.wire.messages.arguments import CommandError
from controller.wire.messages.command_table import parse_command, read_command
from controller.wire.messages.commands import (
    DeckCommand,
    EmergencyStop,
    GetPhase,
    GetStatus,
    GiveBeat,
    Home,
    Jump,
    LockPhase,
    Pause,
    Queue,
    Reset,
    Resume,
    SetInput,
    SetTempo,
    Stop,
    Switch,
    Unlock,
    encode,
)
from controller.wire.messages.deck_snapshot import LockState, Recognized
from controller.wire.messages.replies import Accepted, PhaseNow, Refused, Reply, Settled, State, read_reply
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from waiting import PATIENCE


@dataclass
class Progress:
    commanded_s: float
    settled_s: float | None = None
    after: str = ""
    via: tuple[str, ...] = ()
    overtaken: bool = False
    fell_back: str = ""


@dataclass
class TinyDeck:
    """A deck whose switches settle after 3 updates, unless another comes before."""

    motions: tuple[str, ...] = ("walk", "jog", "waltz")
    motion: str = "walk"
    tempo: float = 1.0
    blend: tuple[tuple[str, float], ...] = ()
    fell_back: str = ""
    paused: bool = False
    time: float = 0.0
    under_way: Progress | None = None
    queue: list[str] = field(default_factory=list)
    ramp: float = 0.0
    events: deque = field(default_factory=deque)
    phase: float | None = None
    inputs: dict[str, float] = field(default_factory=dict)
    layered: dict[str, str] = field(default_factory=dict)
    lock_state: LockState | None = None
    beats: list[float] = field(default_factory=list)
    phase_at: float | None = None
    way: tuple[str, ...] = ()
    commanded_tempo: float = 1.0
    restarts: int = 0

    @property
    def playing(self):
        return self.motion

    @property
    def phase_rate(self):
        return None if self.phase is None else 0.5 * self.tempo

    @property
    def settled(self):
        return self.under_way is None

    def switch(self, to, *, direct=False):
        if to not in self.motions:
            raise UnknownNameError.among("motion", to, self.motions)
        if self.under_way:
            self.under_way.overtaken = True
        self.motion, self.under_way = to, Progress(self.time, via=() if direct else ("stairs",))
        return self.under_way

    def enqueue(self, to):
        self.queue.append(to)
        return Progress(self.time)

    def blend_in(self, first, second, weight, also=()):
        self.blend = ((second, weight), *also)
        return self.switch(first)

    def set_tempo(self, factor, over=0.0):
        self.tempo, self.ramp = factor, over

    def step_on(self, seconds=0.0):
        self.time += seconds

    def set_input(self, name, value, seconds):
        if name != "speed":
            raise MotiondeckError(f"unknown input '{name}'")
        self.inputs[name] = value

    def gaze(self, *point):
        self.inputs |= dict(zip(("left", "up", "ahead", "for"), point, strict=True))

    def layer(self, group, motion, weight=1.0, tempo=1.0):
        self.layered[group] = f"{motion} {weight:g} {tempo:g}"

    def jump(self, phase):
        if self.phase is None:
            raise MotiondeckError("no phase")
        self.phase = phase

    def lock(self, source, phase=0.0, steps=0):
        if self.phase is None:
            raise MotiondeckError("no phase")
        self.lock_state = LockState(source, "searching", phase, float(steps))

    def unlock(self):
        self.lock_state = None

    def follow(self, motion, phase, tempo=1.0, ago=0.0):
        self.followed = motion, phase, tempo, ago

    def beat(self, ago=0.0):
        self.beats.append(ago)

    def pause(self):
        self.paused = True

    def resume(self):
        self.paused = False

    def update(self, dt):
        self.time += dt
        if self.under_way and self.time - self.under_way.commanded_s > 2.5 * dt:
            self.under_way.settled_s, self.under_way = self.time, None
        return np.zeros(1), Pose(np.zeros(3), np.array(0.0), np.array([[1.0, 0.0, 0.0, 0.0]]))


def raw_socket(port):
    """A connection that sends any bytes."""
    made = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    made.setblocking(False)
    made.connect(str(command_folder() / str(port)))
    return made


class Stage:
    """A deck, its desk and a client, brought forward tick by tick."""

    def __init__(self):
        self.deck, self.server, self.stop = TinyDeck(), CommandServer(0), StopRequest()
        self.desk = CommandHandler(CommandedRun(self.deck), [self.server])
        self.client = CommandClient(self.server.port)

    def tick(self):
        self.desk(self.stop)
        self.deck.update(0.01)

    def ask(self, message):
        number = self.client.post(message)
        self.tick()
        while (reply := self.client.receive(1.0)) is not None:
            if reply.id == number:
                return reply
            self.client._settled[reply.id] = reply
        raise AssertionError("there is no answer")

    def send_raw(self, *datagrams):
        """Throws bytes at the server from a socket of its own, and returns the answers."""
        with closing(raw_socket(self.server.port)) as thrower:
            for data in datagrams:
                thrower.send(data)
            self.tick()
            replies = []
            while True:
                try:
                    replies.append(read_reply(thrower.recv(65536)))
                except BlockingIOError:
                    return replies


@pytest.fixture
def stage():
    stage = Stage()
    with closing(stage.server), closing(stage.client):
        yield stage


def test_every_command_does_what_it_says(stage):
    assert isinstance(stage.ask(SetTempo(1.5)), Accepted)
    assert isinstance(stage.ask(Pause()), Accepted)
    reply = stage.ask(GetStatus())
    assert (reply.motion, reply.motions, reply.tempo, reply.paused) == ("walk", ["walk", "jog", "waltz"], 1.5, True)
    assert (reply.switching, reply.at) == (False, 0.02)
    assert isinstance(stage.ask(Resume()), Accepted)
    assert not stage.deck.paused
    assert not stage.stop
    assert isinstance(stage.ask(Stop()), Accepted)
    assert stage.stop.reason == "stopped on command"


def test_a_switch_says_its_way_and_queueing_and_tempo_arrive(stage):
    assert stage.ask(Switch("jog")).via == ["stairs"]
    assert stage.ask(Switch("jog", direct=True)).via == []
    assert isinstance(stage.ask(Queue("waltz")), Accepted)
    assert isinstance(stage.ask(SetTempo(2.0, over=3.0)), Accepted)
    assert (stage.deck.tempo, stage.deck.ramp) == (2.0, 3.0)
    assert stage.ask(GetStatus()).queue == ["waltz"]


def test_an_input_arrives_and_the_state_says_it(stage):
    assert isinstance(stage.ask(SetInput("speed", 1.4)), Accepted)
    assert stage.ask(GetStatus()).inputs == {"speed": 1.4}
    assert "unknown input 'mood'" in stage.ask(SetInput("mood", 1.0)).reason
    assert parse_command(["input", "speed", "0.7"]) == SetInput("speed", 0.7)
    assert isinstance(stage.ask(parse_command(["layer", "jaw", "talk", "0.8"])), Accepted)
    assert stage.ask(GetStatus()).layers == {"jaw": "talk 0.8 1"}
    assert isinstance(stage.ask(parse_command(["gaze", "0.4", "-0.1"])), Accepted)
    assert stage.ask(GetStatus()).inputs == {"speed": 1.4, "left": 0.4, "up": -0.1, "ahead": 1.0, "for": 0.5}
    with pytest.raises(CommandError, match="input: VALUE must be a number"):
        parse_command(["input", "speed", "fast"])


def test_a_jump_arrives_and_the_state_says_the_phase(stage):
    assert stage.ask(GetStatus()).phase is None
    assert isinstance(stage.ask(Jump(0.25)), Refused)
    stage.deck.phase = 0.0
    assert isinstance(stage.ask(Jump(0.25)), Accepted)
    assert stage.ask(GetStatus()).phase == 0.25


def test_locks_beats_and_the_phase_arrive(stage):
    assert isinstance(stage.ask(LockPhase("beat")), Refused)
    reply = stage.ask(GetPhase())
    assert reply == PhaseNow("walk", None, None, reply.id)
    stage.deck.phase = 0.25
    assert isinstance(stage.ask(LockPhase("beat", phase=0.5, steps=4)), Accepted)
    assert stage.ask(GetStatus()).lock == LockState("beat", "searching", 0.5, 4.0)
    assert isinstance(stage.ask(GiveBeat(ago=0.125)), Accepted)
    assert stage.deck.beats == [0.125]
    assert isinstance(stage.ask(Unlock()), Accepted)
    assert stage.ask(GetStatus()).lock is None
    reply = stage.ask(GetPhase())
    assert reply == PhaseNow("walk", 0.25, 0.5, reply.id)
    (refused,) = stage.send_raw(b'{"type":"lock","source":"moon"}')
    assert "Invalid enum value 'moon'" in refused.reason
    (refused,) = stage.send_raw(b'{"type":"lock","source":"beat","steps":17}')
    assert "STEPS must be a whole number from 0 to 16, not 17" in refused.reason


def test_the_emergency_stop_is_latched_until_reset(stage):
    refused = stage.ask(Reset())
    assert isinstance(refused, Refused)
    assert "nothing to reset" in refused.reason
    assert isinstance(stage.ask(EmergencyStop()), Accepted)
    assert stage.ask(GetStatus()).mode == "emergency stop"
    assert stage.deck.paused
    for message in (
        Switch("jog"),
        Queue("jog"),
        SetTempo(2.0),
        Jump(0.5),
        GiveBeat(),
        LockPhase("beat"),
        Pause(),
        Resume(),
        Home(),
    ):
        refused = stage.ask(message)
        assert isinstance(refused, Refused)
        assert "release it with: reset" in refused.reason
    assert stage.deck.motion == "walk"
    assert "still braking" in stage.ask(Reset()).reason
    stage.stop.state.rested()
    assert isinstance(stage.ask(Reset()), Accepted)
    assert (stage.ask(GetStatus()).mode, stage.deck.paused) == ("held", True)
    assert isinstance(stage.ask(Resume()), Accepted)
    assert (stage.ask(GetStatus()).mode, stage.deck.paused) == ("playing", False)


def test_from_home_a_motion_goes_on(stage):
    assert isinstance(stage.ask(Home()), Accepted)
    assert (stage.ask(GetStatus()).mode, stage.deck.paused) == ("home", True)
    assert isinstance(stage.ask(Switch("jog")), Accepted)
    assert (stage.ask(GetStatus()).mode, stage.deck.paused) == ("playing", False)


def test_an_emergency_stop_behind_a_flood_is_carried_out_in_the_same_tick(stage):
    with closing(CommandClient(stage.server.port)) as flooder:
        for _ in range(60):
            flooder.post(Resume())
        flooder.post(EmergencyStop())
        stage.tick()
    assert stage.stop.emergency


def test_a_stop_works_while_the_emergency_stop_is_on(stage):
    stage.ask(EmergencyStop())
    assert isinstance(stage.ask(Stop()), Accepted)
    assert stage.stop.reason == "stopped on command"


def test_a_client_that_never_reads_its_answers_holds_up_nobody(stage):
    with closing(CommandClient(stage.server.port)) as deaf:
        for _ in range(60):
            for _ in range(50):
                deaf.post(GetStatus())  # the answers are more than its socket can hold
            stage.tick()
        assert isinstance(stage.ask(GetStatus()), State)
        assert stage.ask(Switch("jog")).id


def test_a_client_that_has_gone_before_its_switch_settled_does_no_harm(stage):
    with closing(CommandClient(stage.server.port)) as gone:
        gone.post(Switch("jog"))
        stage.tick()
    for _ in range(5):
        stage.tick()
    assert stage.deck.settled
    assert isinstance(stage.ask(GetStatus()), State)


def test_the_state_says_what_the_joints_look_like_and_how_surely(stage):
    recognition = SimpleNamespace(seen=None, mismatch_s=0.0, stuck="")
    run = CommandedRun(stage.deck, snapshots=SnapshotSource(stage.deck, recognition=recognition))
    stage.desk = CommandHandler(run, [stage.server])
    assert stage.ask(GetStatus()).seen is None
    recognition.seen = Recognized("jog", 0.75)
    assert stage.ask(GetStatus()).seen == ("jog", 0.75)


def test_a_blend_that_fell_back_is_answered_with_why_and_the_state_says_it_too(stage):
    accepted = stage.ask(Switch("jog"))
    why = "walk with 0.50 of jog turns over, fell back to walk"
    stage.deck.under_way.fell_back = stage.deck.fell_back = why
    stage.tick()
    assert stage.client.wait_settled(accepted.id, 1.0) == Refused(why, accepted.id)
    assert stage.ask(GetStatus()).fell_back == why


def test_a_note_is_taken_of_each_command(stage):
    noted = []
    stage.desk = CommandHandler(CommandedRun(stage.deck), [stage.server], lambda *both: noted.append(both))
    stage.ask(Pause())
    stage.ask(Switch("wlak"))
    assert [(type(message), type(reply)) for message, reply in noted] == [(Pause, Accepted), (Switch, Refused)]


def test_a_switch_is_answered_again_when_it_has_settled(stage):
    accepted = stage.ask(Switch("jog"))
    for _ in range(5):
        stage.tick()
    assert stage.client.wait_settled(accepted.id, 1.0) == Settled("jog", pytest.approx(0.03), accepted.id)


def test_a_switch_overtaken_by_another_is_said_to_be(stage):
    first, second = stage.ask(Switch("jog")), stage.ask(Switch("waltz"))
    for _ in range(5):
        stage.tick()
    assert stage.client.wait_settled(second.id, 1.0).to == "waltz"
    overtaken = stage.client.wait_settled(first.id, 1.0)
    assert isinstance(overtaken, Refused)
    assert "overtaken" in overtaken.reason


def test_how_a_switch_came_out_is_kept_while_other_requests_are_made(stage):
    first = stage.client.post(Switch("jog"))
    stage.tick()
    stage.client.post(Switch("waltz"))
    stage.tick()
    with pytest.raises(SocketError):
        stage.client.request(GetStatus(), 0.01)  # reads past the words about the first one
    assert "overtaken" in stage.client.wait_settled(first, 0.01).reason


def test_a_client_that_never_waits_keeps_the_latest_outcomes_only(stage):
    for number in range(1, 400):
        stage.client.post(Switch("jog" if number % 2 else "waltz"))
        stage.tick()
        if number % 20 == 0:
            with pytest.raises(SocketError):
                stage.client.request(GetStatus(), 0.001)
    assert len(stage.client._settled) <= 256


def test_waiting_for_a_switch_that_does_not_settle_ends(stage):
    assert stage.client.wait_settled(stage.ask(Switch("jog")).id, 0.01) is None


def test_what_the_deck_refuses_is_refused_with_its_reason(stage):
    reply = stage.ask(Switch("walz"))
    assert isinstance(reply, Refused)
    assert "waltz" in reply.reason


@pytest.mark.parametrize("factor", [-3.5, 3.5])
def test_a_tempo_out_of_range_is_refused_and_says_the_range(stage, factor):
    reply = stage.ask(SetTempo(factor))
    assert isinstance(reply, Refused)
    assert "from -3 to 3" in reply.reason
    assert stage.deck.tempo == 1.0


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b" ", "not a command"),
        (b'{"type":"dance"}', "switch MOTION [direct], queue MOTION, blend A B WEIGHT [C WEIGHT ...]"),
        (b'{"type":"switch"}', "to"),
        (b'{"type":"switch","to":""}', "1 to 100 characters"),
        (b'{"type":"switch","to":"' + b"a" * 101 + b'"}', "1 to 100 characters"),
        (b'{"type":"tempo","factor":"fast"}', "float"),
        (b'{"type":"tempo","factor":1e999}', "not a command"),
        (b'{"type":"tempo","factor":1,"over":-1}', "from 0 to 60, not -1"),
        (b'{"type":"queue","to":""}', "1 to 100 characters"),
        (b'{"type":"pause","for":3}', "for"),
        (b'{"type":"pause","id":-1}', "id"),
        (b'{"type":"pause","id":99999999999999999999999}', "not a command"),
        (b"[" * 2000, "not a command"),
        (b"x" * 3000, "too long"),
    ],
)
def test_nonsense_is_refused_with_what_would_have_been_right(stage, data, said):
    (reply,) = stage.send_raw(data)
    assert isinstance(reply, Refused)
    assert said in reply.reason
    assert stage.server.traffic.malformed == 1


def test_a_refusal_carries_the_number_of_what_it_refuses(stage):
    assert [reply.id for reply in stage.send_raw(b'{"type":"dance","id":12}', b'{"id":"x"}')] == [12, 0]


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.one_of(
            st.binary(min_size=1, max_size=200),
            st.builds(
                lambda message, place, byte: message[:place] + bytes([byte]) + message[place + 1 :],
                st.sampled_from([encode(Switch("jog", id=3)), encode(SetTempo(1.5, id=2**40)), encode(GetStatus())]),
                st.integers(0, 40),
                st.integers(0, 255),
            ),
            st.recursive(st.none() | st.integers() | st.text(max_size=5), lambda x: st.lists(x, max_size=3)).map(
                lambda value: repr(value).encode()
            ),
        ),
        max_size=20,
    )
)
def test_whatever_bytes_arrive_nothing_raises_and_the_next_command_works(datagrams):
    stage = Stage()
    with closing(stage.server), closing(stage.client):
        stage.send_raw(*datagrams)
        stage.tick()
        stage.tick()
        traffic = stage.server.traffic
        assert traffic.commands + traffic.malformed + traffic.flooded == len(datagrams)
        assert isinstance(stage.ask(GetStatus()), State)


@given(st.binary(max_size=300))
def test_reading_bytes_gives_a_message_or_a_command_error(data):
    for read, kinds in ((read_command, DeckCommand), (read_reply, Reply)):
        try:
            assert isinstance(read(data), kinds)
        except CommandError:
            continue


@given(st.text(min_size=1, max_size=100), st.integers(0, 2**53 - 1))
def test_messages_survive_the_wire(name, number):
    try:
        data = encode(Switch(name, id=number))
    except UnicodeEncodeError:
        return
    assert read_command(data) == Switch(name, id=number)


def test_a_flood_from_one_client_leaves_room_for_another(stage):
    with closing(CommandClient(stage.server.port)) as flooder:
        for _ in range(60):
            flooder.post(Switch("jog"))
        assert isinstance(stage.ask(Pause()), Accepted)
        assert (stage.server.traffic.commands, stage.server.traffic.flooded) == (9, 20)
        replies = [flooder.receive(0.1) for _ in range(16)]
    assert [type(reply) for reply in replies] == [Accepted] * 8 + [Refused] * 8


def test_a_burst_of_commands_is_carried_out_in_its_order(stage):
    """A show's cue, or a program after a pause of the deck, says more at once than one tick takes."""
    tempos = [0.5 + 0.02 * number for number in range(30)]
    for tempo in tempos:
        stage.client.post(SetTempo(tempo))
    stage.client.post(EmergencyStop())
    taken = [[message for message, _ in stage.server.poll()] for _ in range(5)]
    assert [len(messages) for messages in taken] == [8, 8, 8, 7, 0]
    assert isinstance(taken[0][0], EmergencyStop)
    assert [message.factor for messages in taken for message in messages if isinstance(message, SetTempo)] == tempos
    assert stage.server.traffic.flooded == 0


def test_one_poll_takes_a_bounded_number(stage):
    stage.client.post(Pause())
    stage.client.post(Pause())
    stage.client.post(Resume())
    assert [message.id for message, _ in stage.server.poll(limit=2)] == [1, 2]
    assert [message.id for message, _ in stage.server.poll(limit=2)] == [3]
    assert list(stage.server.poll()) == []


def test_a_flood_does_not_cost_the_loop_a_tick(stage):
    limits = JointLimits(*(np.array([x]) for x in (-1.0, 1.0, 1.0, 10.0, 100.0)))
    data = [encode(GetStatus(id=3)), b"nonsense", b"{" * 5000]
    clock = VirtualClock(200.0)
    with closing(raw_socket(stage.server.port)) as flooder:

        def commands(stop):
            for _ in range(20):
                for datagram in data:
                    flooder.send(datagram)
            stage.desk(stop)

        report = run(stage.deck, [], clock, SafetyEnvelope(limits, clock.period), seconds=1.0, commands=commands)
    assert (report.ticks, report.faults) == (200, {"deck": 0, "commands": 0, "stops": 0, "telemetry": 0})
    assert stage.server.traffic.malformed > 1000


def test_answering_nobody_does_no_harm(stage):
    with closing(CommandClient(stage.server.port)) as gone:
        gone.post(Switch("jog"))
    for _ in range(10):
        stage.tick()
    assert isinstance(stage.ask(GetStatus()), State)


def test_a_port_in_use_is_said_in_one_line(stage):
    said = f"another deck is running .command port {stage.server.port}."
    with pytest.raises(SocketError, match=said) as caught:
        CommandServer(stage.server.port)
    assert "\n" not in str(caught.value)


def test_what_reading_commands_needs_is_worked_out_before_the_loop_runs():
    """It takes milliseconds; the first command, or datagram that is none, would make a tick late."""
    opened = """
from controller.wire.command_socket import CommandServer
from controller.wire.messages.command_table import COMMANDS
CommandServer(0).close()
print({"arguments" in vars(row) for row in COMMANDS})
"""
    done = subprocess.run([sys.executable, "-c", opened], capture_output=True, text=True, check=True)
    assert done.stdout == "{True}\n"


@pytest.mark.parametrize("port", [-1, 70_000])
def test_a_port_that_cannot_be_is_refused(port):
    with pytest.raises(SocketError, match=str(port)):
        CommandServer(port)
    with pytest.raises(SocketError, match=str(port)):
        CommandClient(port)


def test_with_no_deck_running_the_client_says_how_to_start_one():
    server = CommandServer(0)
    server.close()
    with closing(CommandClient(server.port)) as client:
        for _ in range(2):
            with pytest.raises(SocketError, match=f"no deck is running on port {server.port}.*motiondeck play"):
                client.request(GetStatus())


def test_a_deck_that_does_not_answer_is_none(stage):
    with pytest.raises(SocketError, match="does not reply"):
        stage.client.request(GetStatus(), timeout_s=0.01)


def test_a_client_waits_for_its_own_answer(stage):
    stage.client.post(Switch("jog"))
    stage.client.post(Pause())
    for _ in range(5):
        stage.tick()
    finished = threading.Event()

    def serve():
        while not finished.is_set():
            stage.tick()
            finished.wait(0.002)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        reply = stage.client.request(GetStatus())
        assert isinstance(reply, State)
        assert (reply.id, reply.motion, reply.paused) == (3, "jog", True)
        assert stage.client.wait_settled(1, PATIENCE).to == "jog"
    finally:
        finished.set()
        thread.join()
