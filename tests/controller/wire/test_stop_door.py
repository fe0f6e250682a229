"""The stop door: an emergency stop is taken there whatever crowds it, and nothing else is."""

import select
import socket
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, closing

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.wire.command_socket import CommandClient, CommandServer, SocketError
from controller.wire.local_transport import MOST_CLIENTS, command_folder
from controller.wire.messages.commands import EmergencyStop, GetStatus, Reset, Stop, Switch, encode
from controller.wire.messages.replies import Accepted, Refused, Settled, read_reply
from controller.wire.stop_door import PLACES, StopDoor
from idle_programs import connected, idle_programs
from waiting import PATIENCE, quick, until


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder for sockets of this test alone."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / "motiondeck"


@pytest.fixture
def door():
    with closing(StopDoor(47810)) as door:
        yield door


@pytest.fixture
def deck():
    """A command socket and a stop door, polled 200 times a second as by a loop."""
    over, presses = threading.Event(), []
    with closing(CommandServer(47810)) as server, closing(StopDoor(47810)) as door:

        def serve():
            while not over.wait(0.005):
                presses.append(door.poll())
                for message, sender in server.poll():
                    server.reply(sender, Accepted(message.id))
                    if isinstance(message, Switch):
                        server.reply(sender, Settled(message.to, 0.5, message.id))

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield presses
        finally:
            over.set()
            thread.join()


def at_door():
    """A connection to the door."""
    return connected(command_folder() / "47810.stop")


def replies(connection):
    found = []
    while True:
        try:
            data = connection.recv(65536)
        except BlockingIOError:
            return found
        if not data:
            return found
        found.append(read_reply(data))


def test_a_press_is_counted_and_acknowledged(door):
    with closing(at_door()) as one:
        assert door.poll() == 0
        one.send(encode(EmergencyStop(id=7)))
        assert door.poll() == 1
        assert replies(one) == [Accepted(7)]
        assert door.poll() == 0


@pytest.mark.parametrize(
    "data", [encode(GetStatus(id=3)), encode(Stop(id=3)), encode(Reset(id=3)), b'{"type":"estop","id":3,"x":1}']
)
def test_anything_else_is_refused(door, data):
    with closing(at_door()) as one:
        one.send(data)
        assert door.poll() == 0
        assert replies(one) == [
            Refused("only an emergency stop is taken here; give commands at the deck's command socket", 3)
        ]


@given(st.lists(st.one_of(st.binary(min_size=1, max_size=40), st.just(b"{" * 5000), st.just(b'"estop"')), max_size=20))
@settings(deadline=None)
def test_whatever_bytes_arrive_each_is_refused_and_the_next_stop_works(datagrams):
    with closing(StopDoor(47810)) as door, closing(at_door()) as one:
        for data in datagrams:
            one.send(data)
        one.send(encode(EmergencyStop(id=5)))
        assert door.poll() == 1
        *refused, accepted = replies(one)
        assert [type(reply) for reply in refused] == [Refused] * len(datagrams)
        assert accepted == Accepted(5)


@given(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 4), st.booleans()), max_size=30))
@settings(deadline=None)
def test_a_stop_that_is_sent_again_counts_once_on_its_connection(sent):
    with closing(StopDoor(47810)) as door, ExitStack() as opened:
        programs = [opened.enter_context(closing(at_door())) for _ in range(3)]
        counted = 0
        for program, number, polled in sent:
            programs[program].send(encode(EmergencyStop(id=number)))
            counted += door.poll() if polled else 0
        counted += door.poll()
        anew = [(program, number) for program, number, _ in sent if number]
        assert counted == len(set(anew)) + len(sent) - len(anew)  # without a number each counts
        for place, program in enumerate(programs):
            assert replies(program) == [Accepted(number) for to, number, _ in sent if to == place]


@pytest.mark.parametrize("idle", [1, PLACES, 1000])
def test_idle_programs_at_the_door_keep_no_stop_out(deck, idle):
    with (
        idle_programs(command_folder() / "47810.stop", idle),
        closing(CommandClient(47810)) as client,
    ):
        for _ in range(2):
            assert isinstance(client.request(EmergencyStop()), Accepted)
    until(lambda: sum(deck) == 2, "both presses")


GREEDY = """
import socket, sys
there = []
while True:
    one = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        one.connect(sys.argv[1])
        one.setblocking(False)
        there.append(one)
        for _ in range(20):
            there[-1].send(b"nonsense")
            there[0].send(b"nonsense")
    except BlockingIOError:
        pass
    except BrokenPipeError:
        there.pop(0).close()
"""


def test_greedy_programs_at_the_door_keep_no_stop_out(door, folder):
    """They fill it with nonsense as fast as they can, and come back when they have to leave."""
    over, presses = threading.Event(), []

    def serve():
        while not over.wait(0.005):
            presses.append(door.poll())

    serving = threading.Thread(target=serve)
    serving.start()
    crowd = [subprocess.Popen([sys.executable, "-c", GREEDY, str(folder / "47810.stop")]) for _ in range(2)]
    try:
        deadline = time.monotonic() + 60.0
        with closing(at_door()) as one:
            while True:
                assert time.monotonic() < deadline, "nothing makes it leave"
                try:
                    one.send(b"nonsense")
                except BlockingIOError:
                    pass
                except OSError:
                    break  # the crowd is there
        for _ in range(20):
            with closing(CommandClient(47810)) as client:
                assert isinstance(client.request(EmergencyStop()), Accepted)
    finally:
        over.set()
        serving.join()
        for program in crowd:
            program.kill()
            program.wait()
    assert sum(presses) == 20


def test_a_program_that_has_to_leave_is_the_longest_idle_and_is_heard_to_the_end(door):
    with ExitStack() as opened:
        there = [opened.enter_context(closing(at_door())) for _ in range(PLACES)]
        assert door.poll() == 0
        there[0].send(b"heard")
        assert door.poll() == 0
        opened.enter_context(closing(at_door()))
        there[1].send(encode(GetStatus()))
        there[1].send(encode(EmergencyStop(id=9)))
        assert door.poll() == 1
        assert replies(there[1])[-1] == Accepted(9)
        with pytest.raises(OSError, match="Broken pipe"):
            there[1].send(b"it has left")
        there[0].send(b"it is there")


def test_a_program_that_has_just_come_has_a_tick_to_send_its_stop_in(door):
    with ExitStack() as opened:
        there = [opened.enter_context(closing(at_door())) for _ in range(3 * PLACES)]
        assert door.poll() == 0
        there[0].send(encode(EmergencyStop()))
        assert door.poll() == 1


def test_a_stop_of_a_program_that_hangs_up_at_once_is_taken(door):
    with closing(at_door()) as one:
        one.send(encode(EmergencyStop(id=1)))
    assert door.poll() == 1


def test_the_work_of_one_poll_is_bounded_and_the_rest_is_done_by_the_next(door):
    with ExitStack() as opened:
        for _ in range(10):
            connection = opened.enter_context(closing(at_door()))
            for number in range(1, 101):
                connection.send(encode(EmergencyStop(id=number)))
        counts = []
        while not counts or counts[-1]:
            counts.append(door.poll())
    assert sum(counts) == 1000
    assert max(counts) < 150


def test_it_is_gone_when_it_is_closed_and_what_a_killed_one_has_left_is_taken_over(folder):
    door = StopDoor(47810)
    with pytest.raises(SocketError, match="another deck is running"):
        StopDoor(47810)
    door.close()
    door.close()
    assert [file.name for file in folder.iterdir()] == ["lock"]
    dead = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    dead.bind(str(folder / "47810.stop"))
    dead.close()
    StopDoor(47810).close()


def test_the_guards_process_needs_nothing_heavy_for_it():
    seen = "import sys, controller.wire.stop_door; print(*{name.partition('.')[0] for name in sys.modules})"
    done = subprocess.run([sys.executable, "-c", seen], capture_output=True, text=True, check=True)
    assert not {"numpy", "scipy", "mujoco", "sim", "hardware", "motiondeck"} & set(done.stdout.split())


@pytest.mark.parametrize("idle", [MOST_CLIENTS, 1000])
def test_a_deck_full_of_idle_programs_is_stopped_and_others_read_that_it_is_full(deck, idle):
    with idle_programs(command_folder() / "47810", idle), closing(CommandClient(47810)) as client:
        for _ in range(2):
            with pytest.raises(SocketError, match="the deck is full"):
                client.request(GetStatus())
            assert isinstance(client.request(EmergencyStop()), Accepted)
    until(lambda: sum(deck) == 2, "both presses")


def test_a_stop_works_where_no_command_was_sent_and_after_the_command_socket_is_gone(door):
    server = CommandServer(47810)
    with closing(CommandClient(47810)) as client:
        client.post(GetStatus())
        server.close()
        number = client.post(EmergencyStop())
        assert client.receive(0.0) is None
        assert door.poll() == 1
        assert client.receive(0.0) == Accepted(number)
        with pytest.raises(SocketError, match="no deck is running"):
            client.receive(0.0)


def test_a_deck_without_a_door_takes_the_stop_as_a_command():
    with closing(CommandServer(47810)) as server, closing(CommandClient(47810)) as client:
        number = client.post(EmergencyStop())
        assert [message for message, _ in server.poll()] == [EmergencyStop(id=number)]


@pytest.mark.parametrize("served", ["door", "no door"])
def test_a_stop_that_nothing_acknowledges_is_said_within_half_a_second(served, hasty):
    with ExitStack() as opened, closing(CommandClient(47810)) as client:
        opened.enter_context(closing(StopDoor(47810) if served == "door" else CommandServer(47810)))

        def press():
            with pytest.raises(SocketError, match="the emergency stop is not acknowledged"):
                client.request(EmergencyStop())

        quick(press, 1.0)


def test_a_reply_from_the_door_makes_the_client_readable_and_comes_before_what_follows_it(door):
    with closing(CommandServer(47810)) as server, closing(CommandClient(47810)) as client:
        for _ in range(50):
            numbers = [client.post(message) for message in (EmergencyStop(), GetStatus())]
            assert door.poll() == 1
            assert select.select([client], [], [], PATIENCE)[0] == [client]
            for message, sender in server.poll():
                server.reply(sender, Accepted(message.id))
            assert [client.receive(PATIENCE).id for _ in numbers] == numbers


def test_a_request_that_the_deck_cannot_read_is_refused(deck):
    with closing(CommandClient(47810)) as client:
        assert "too long" in client.request(Switch("x" * 3000)).reason


def test_threads_share_a_client_and_each_gets_its_own_reply(deck):
    answered, stopped = [], []
    start = threading.Barrier(31)
    with closing(CommandClient(47810)) as client:

        def ask():
            start.wait()
            for _ in range(20):
                answered.append(client.request(GetStatus()).id)

        def stop():
            start.wait()
            stopped.extend(client.request(EmergencyStop()).id for _ in range(5))

        threads = [threading.Thread(target=act) for act in [ask] * 30 + [stop]]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert sorted(answered + stopped) == [*range(1, 606)]
    until(lambda: sum(deck) == 5, "all presses")


def test_a_thread_that_waits_for_a_second_reply_holds_no_other_up(deck):
    with closing(CommandClient(47810)) as client:
        client.request(GetStatus())
        settled = []
        waiting = threading.Thread(target=lambda: settled.append(client.wait_settled(12, 2 * PATIENCE)))
        waiting.start()
        for _ in range(10):
            client.request(GetStatus())
        assert waiting.is_alive()
        client.request(Switch("walk"))
        waiting.join()
        assert settled == [Settled("walk", 0.5, 12)]
