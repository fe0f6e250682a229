"""Command sockets of this user: nobody else may come near, and what a killed deck leaves does no harm."""

import os
import resource
import socket
import struct
import subprocess
import sys
import threading
from contextlib import ExitStack, closing
from types import SimpleNamespace

import pytest

from controller.wire import local_transport
from controller.wire.command_socket import CommandClient, CommandServer, SocketError
from controller.wire.local_transport import MOST_CLIENTS, command_folder
from controller.wire.messages.commands import EmergencyStop, GetStatus, Pause
from controller.wire.stop_door import StopDoor
from waiting import quick


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder for sockets of this test alone."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / "motiondeck"


def test_sockets_are_in_a_folder_of_the_users_own_and_gone_afterwards(folder):
    with closing(CommandServer(0)) as server:
        about = folder.stat()
        assert (about.st_mode & 0o777, about.st_uid) == (0o700, os.geteuid())
        assert sorted(file.name for file in folder.iterdir()) == sorted(["lock", str(server.port)])
    assert [file.name for file in folder.iterdir()] == ["lock"]


def test_without_a_folder_of_the_session_sockets_are_in_the_temporary_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "none"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    with closing(CommandServer(0)):
        (folder,) = tmp_path.iterdir()
        assert folder == command_folder() == tmp_path / f"motiondeck-commands-{os.geteuid()}"


def test_a_folder_with_too_long_a_name_is_refused_with_the_remedy(tmp_path, monkeypatch):
    (tmp_path / (120 * "d")).mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / (120 * "d")))
    with pytest.raises(SocketError, match="Set XDG_RUNTIME_DIR to a folder of your own with a short path"):
        CommandServer(0)


@pytest.mark.parametrize("mode", [0o755, 0o770, 0o750, 0o710, 0o701])
@pytest.mark.parametrize("opened", [CommandServer, StopDoor])
def test_a_folder_that_others_may_enter_is_refused(folder, opened, mode):
    folder.mkdir()
    folder.chmod(mode)
    with pytest.raises(SocketError, match="chmod 700"):
        opened(47810)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
def test_a_folder_of_another_user_is_refused(folder):
    folder.mkdir(mode=0o700)
    os.chown(folder, 65534, 65534)
    with pytest.raises(SocketError, match="others could command"):
        CommandServer(0)


def test_a_folder_behind_a_link_is_refused(folder, tmp_path):
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    folder.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(SocketError, match="others could command"):
        CommandServer(0)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can act as somebody else")
def test_another_user_can_neither_command_nor_take_the_place_of_the_deck():
    with closing(CommandServer(0)) as server:
        attempt = f"""
import os, socket
os.setgid(65534); os.setuid(65534)
path = {str(command_folder() / str(server.port))!r}
for act in ("connect", "bind"):
    try:
        getattr(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET), act)(path)
        print("done")
    except PermissionError:
        print("refused")
"""
        done = subprocess.run([sys.executable, "-c", attempt], capture_output=True, text=True, check=True)
        assert done.stdout.split() == ["refused", "refused"]


@pytest.fixture
def peers(monkeypatch):
    """The users, as the system tells them, of the programs that connect; None for who they really are."""
    told = SimpleNamespace(user=None)

    class Peer(socket.socket):
        def getsockopt(self, level, name, length=0):
            if told.user is None or (level, name) != (socket.SOL_SOCKET, socket.SO_PEERCRED):
                return super().getsockopt(level, name, length)
            return struct.pack("3i", os.getpid(), told.user, os.getgid())

        def accept(self):
            number, address = self._accept()
            return Peer(fileno=number), address

    monkeypatch.setattr(local_transport.socket, "socket", Peer)
    return told


@pytest.mark.parametrize(("user", "taken"), [(os.geteuid(), True), (0, True), (65534, False)])
def test_commands_and_stops_are_taken_from_this_user_and_root_alone(folder, peers, user, taken):
    """The folder keeps others out; who is in nevertheless, by a descriptor that was passed on, is asked too."""
    with (
        closing(CommandServer(0)) as server,
        closing(StopDoor(server.port)) as door,
        closing(CommandClient(server.port)) as client,
    ):
        peers.user = user
        client.post(Pause())
        client.post(EmergencyStop())
        assert (len(list(server.poll())), door.poll()) == (taken, taken)


def test_what_a_killed_deck_has_left_is_taken_over(folder):
    folder.mkdir(mode=0o700)
    dead = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    dead.bind(str(folder / "47810"))
    dead.listen()
    with pytest.raises(SocketError, match="another deck is running"):
        CommandServer(47810)
    dead.close()
    with closing(CommandClient(47810)) as client, pytest.raises(SocketError, match="no deck is running"):
        client.post(GetStatus())
    with closing(CommandServer(47810)) as server, closing(CommandClient(47810)) as client:
        client.post(Pause())
        assert len(list(server.poll())) == 1


def test_a_deck_that_closes_does_not_remove_the_socket_of_its_successor(folder):
    first = CommandServer(47810)
    (folder / "47810").unlink()
    with closing(CommandServer(47810)), closing(CommandClient(47810)) as client:
        first.close()
        client.post(Pause())


def test_a_client_notices_at_once_that_the_deck_has_ended(folder):
    server = CommandServer(0)
    with closing(CommandClient(server.port)) as client:
        client.post(GetStatus())
        list(server.poll())
        server.close()
        with pytest.raises(SocketError, match="no deck is running"):
            client.receive(10.0)


def test_a_crowd_of_clients_is_limited_and_those_there_are_served(folder):
    with closing(CommandServer(0)) as server, closing(CommandClient(server.port)) as client:
        client.post(GetStatus())
        assert len(list(server.poll())) == 1
        crowd = []
        for _ in range(4):
            for _ in range(40):
                crowd.append(CommandClient(server.port))
                crowd[-1].post(Pause())
            list(server.poll())
        client.post(GetStatus())
        assert [type(message) for message, _ in server.poll()] == [GetStatus]
        for one in crowd:
            one.close()


@pytest.fixture
def full(folder):
    """A server with as many idle programs connected as it takes, and a function that connects more."""
    with closing(CommandServer(0)) as server, ExitStack() as opened:

        def connect(count):
            clients = []
            for number in range(count):
                clients.append(opened.enter_context(closing(CommandClient(server.port))))
                clients[-1].post(GetStatus())
                if number % 16 == 15:
                    list(server.poll())
            list(server.poll())
            return clients

        connect.there = connect(MOST_CLIENTS)
        yield server, connect


def test_a_full_deck_says_that_it_is_full(full):
    server, connect = full
    (late,) = connect(1)
    for _ in range(2):
        with pytest.raises(SocketError, match="the deck is full"):
            late.receive(1.0)
    late.post(GetStatus())
    assert list(server.poll()) == []
    with pytest.raises(SocketError, match="the deck is full"):
        late.receive(1.0)


def test_a_full_deck_says_so_to_a_program_that_sends_after_it_was_turned_away(full):
    server, connect = full
    (late,) = connect(1)
    polling = threading.Event()

    def serve():
        while not polling.wait(0.001):
            list(server.poll())

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        for _ in range(50):
            with pytest.raises(SocketError, match="the deck is full"):
                late.request(GetStatus())
    finally:
        polling.set()
        thread.join()


def test_programs_that_are_connected_to_a_full_deck_are_served(full):
    server, connect = full
    connect(300)
    number = connect.there[-1].post(EmergencyStop())  # there is no door here
    assert [message for message, _ in server.poll()] == [EmergencyStop(id=number)]


def test_a_place_that_is_left_is_taken_by_the_next(full):
    server, connect = full
    connect.there[0].close()
    list(server.poll())
    late, later = connect(2)
    number = late.post(GetStatus())
    assert [message for message, _ in server.poll()] == [GetStatus(id=number)]
    with pytest.raises(SocketError):
        later.receive(1.0)


def post_many(clients):
    for client in clients:
        client.post(GetStatus())


def refuse(clients):
    """Posts more than the deck takes."""
    with pytest.raises(SocketError, match="it is held up"):
        post_many(clients)


def test_a_look_for_replies_without_time_takes_none(folder):
    """A loop looks so every tick; the shortest wait of the system is a millisecond."""
    with closing(CommandServer(0)) as server, closing(CommandClient(server.port)) as client:
        client.post(GetStatus())
        before = resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw  # how often it waited, however busy the machine
        assert {client.receive(0.0) for _ in range(300)} == {None}
        assert resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw - before < 150


def test_who_has_no_patience_is_not_held_up_by_a_deck_that_takes_nothing(folder):
    with closing(CommandServer(0)) as server, closing(CommandClient(server.port, patience=0.0)) as client:
        quick(lambda: refuse([client] * 10_000), 0.5)
        list(server.poll())
        client.post(GetStatus())


def test_who_has_no_patience_is_not_held_up_by_a_crowd_at_the_door(folder):
    folder.mkdir(mode=0o700)
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)) as busy:
        busy.bind(str(folder / "47810"))
        busy.listen(0)
        crowd = [CommandClient(47810, patience=0.0) for _ in range(4)]
        quick(lambda: refuse(crowd), 0.5)
        for client in crowd:
            client.close()
