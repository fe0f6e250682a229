"""Commands over a network: who has the token is heard once, and nothing that was recorded is heard again."""

import random
import socket
from collections import deque
from contextlib import closing, suppress
from types import SimpleNamespace

import pytest

from controller.wire import command_socket, network_transport
from controller.wire.authentication import sign
from controller.wire.command_socket import CommandClient, CommandServer, SocketError
from controller.wire.messages.commands import EmergencyStop, GetStatus, Reset, Switch
from controller.wire.messages.replies import Accepted
from waiting import PATIENCE, until

TOKEN = b"0123456789abcdef"
HERE = "127.0.0.1"


def arrived(server, wanted=1):
    """The commands that come; a client that greets meanwhile is answered."""
    found = []

    def enough():
        found.extend(server.poll())
        return len(found) >= wanted

    until(enough, "what was sent", PATIENCE)
    return found


def refused(server, datagrams):
    """Waits until so many datagrams in all were refused, and none was taken for a command."""

    def enough():
        assert list(server.poll()) == []
        return server.traffic.malformed + server.traffic.replayed >= datagrams

    until(enough, "what was sent", PATIENCE)
    assert server.traffic.malformed + server.traffic.replayed == datagrams


class Wire:
    """A socket between a client and a server that lets all pass, and keeps what the client sent."""

    def __init__(self, server):
        self._near, self._far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self._near.bind((HERE, 0))
        self._far.connect((HERE, server.port))
        for end in (self._near, self._far):
            end.setblocking(False)
        self.port = self._near.getsockname()[1]
        self._server, self._client = server, None
        self.recorded, self.commands = [], []

    def pump(self, enough):
        """Carries datagrams both ways until it is enough."""

        def carried():
            try:
                data, self._client = self._near.recvfrom(65536)
                self.recorded.append(data)
                self._far.send(data)
            except BlockingIOError:
                pass
            self.commands += self._server.poll()
            with suppress(BlockingIOError):
                self._near.sendto(self._far.recv(65536), self._client)
            return enough()

        until(carried, "what was sent", PATIENCE)

    def replay(self, data):
        """Sends something recorded once more."""
        self._far.send(data)

    def close(self):
        self._near.close()
        self._far.close()


def greeted(client, server):
    """Has a client greet a server: both are of this thread, so the greeting is done step by step."""
    connection = client._connection
    connection._put_body(network_transport._HELLO.pack(b"H", connection._name))
    arrived(server, 0)
    while not connection._challenge:
        list(server.poll())
        connection._take(0.01)
    return client


@pytest.fixture
def server():
    with closing(CommandServer(0, HERE, TOKEN)) as server:
        yield server


@pytest.fixture
def client(server):
    with closing(CommandClient(server.port, HERE, TOKEN)) as client:
        yield greeted(client, server)


class LossyNetwork:
    """The sockets of a server and of clients on a network that loses datagrams, in a time of its own.

    Only a client that waits takes time; the server has answered before.
    """

    def __init__(self, server, loss):
        self.time, self._loss, self._chance = 0.0, loss, random.Random(3)
        self._for_server, self._for_client, self._timeout = deque(), deque(), 0.0
        self.received, self._server = [], server
        server._listener._socket.close()
        server._listener._socket = SimpleNamespace(recvfrom=self._at_server, sendto=self._to_client, close=int)

    def client(self):
        client = CommandClient(self._server.port, HERE, TOKEN)
        client._connection._socket.close()
        client._connection._socket = self
        return client

    def monotonic(self):
        return self.time

    def send(self, data):
        if self._chance.random() >= self._loss:
            self._for_server.append(data)

    def settimeout(self, seconds):
        self._timeout = seconds

    def recv(self, _):
        for message, sender in self._server.poll():
            self.received.append(message)
            self._server.reply(sender, Accepted(message.id))
        if not self._for_client:
            self.time += self._timeout
            raise TimeoutError
        return self._for_client.popleft()

    def _at_server(self, _):
        if not self._for_server:
            raise BlockingIOError
        return self._for_server.popleft(), HERE

    def _to_client(self, data, _):
        if self._chance.random() >= self._loss:
            self._for_client.append(data)


def test_an_emergency_stop_arrives_over_a_network_that_loses_a_fifth_each_way(server, monkeypatch):
    network, took = LossyNetwork(server, 0.2), []
    received = network.received
    for module in (network_transport, command_socket):
        monkeypatch.setattr(module, "time", network)
    for _ in range(40):
        client, began, before = network.client(), network.time, len(received)
        assert isinstance(client.request(EmergencyStop(), 1.0), Accepted)
        took.append(network.time - began)
        assert len(received) > before
    assert max(took) < 1.0
    assert sorted(took)[-4] < 0.12, "what is lost is sent again at once"
    assert {message.id for message in received} == {1}, "each was one press, however often it was sent"


def test_an_emergency_stop_is_sent_until_it_is_answered_by_who_reads_replies_only(server, client, monkeypatch):
    monkeypatch.setattr(command_socket, "_STOP_FOR", PATIENCE)
    number = client.post(EmergencyStop())
    for _ in range(6):
        assert client.receive(0.03) is None
    (first, sender), *more = arrived(server, 3)
    assert len(more) >= 2
    assert {message.id for message, _ in more} == {first.id} == {number}
    server.reply(sender, Accepted(0))  # to another command
    server.reply(sender, Accepted(number))
    assert [client.receive(PATIENCE), client.receive(PATIENCE)] == [Accepted(0), Accepted(number)]
    list(server.poll())
    assert client.receive(0.2) is None
    assert list(server.poll()) == []


def test_who_has_the_token_is_heard_and_answered_under_seal(server, client):
    number = client.post(Switch("walk"))
    ((message, sender),) = arrived(server)
    assert message == Switch("walk", id=number)
    server.reply(sender, Accepted(number))
    assert client.receive(PATIENCE) == Accepted(number)


def test_without_the_token_nobody_is_heard_nor_answered(server):
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as stranger:
        stranger.connect((HERE, server.port))
        hello = network_transport._HELLO.pack(b"H", b"stranger")
        for data in (b"", b"nonsense", hello, sign(b"fedcba9876543210", hello)):
            stranger.send(data)
        refused(server, 4)
        stranger.setblocking(False)
        with pytest.raises(BlockingIOError):
            stranger.recv(100)


def test_a_recorded_reset_sent_again_is_refused_and_counted(server):
    with closing(Wire(server)) as wire, closing(CommandClient(wire.port, HERE, TOKEN)) as client:
        connection = client._connection
        connection._put_body(network_transport._HELLO.pack(b"H", connection._name))
        wire.pump(lambda: connection._take(0.01) is not None)
        for count, message in enumerate((EmergencyStop(), Reset(), GetStatus()), 1):
            client.post(message)
            wire.pump(lambda count=count: len(wire.commands) == count)
        assert [type(message) for message, _ in wire.commands] == [EmergencyStop, Reset, GetStatus]
        for data in wire.recorded[1:]:  # the first one is the greeting
            wire.replay(data)
        refused(server, 3)
        client.post(GetStatus())
        wire.pump(lambda: len(wire.commands) == 4)  # the client itself is still heard


def test_what_was_recorded_of_one_run_is_refused_by_the_next(server, client):
    connection = client._connection
    body = network_transport._COMMAND.pack(b"C", connection._name, connection._challenge, 5) + b'{"type":"reset"}'
    with (
        closing(CommandServer(0, HERE, TOKEN)) as following,
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as attacker,
    ):
        for run in (server, following):
            attacker.sendto(sign(TOKEN, body), (HERE, run.port))
        assert len(arrived(server)) == 1
        refused(following, 1)


def test_a_client_that_the_deck_forgot_is_heard_and_its_old_commands_are_not(server, monkeypatch):
    monkeypatch.setattr(network_transport, "MOST_CLIENTS", 2)
    clients = [greeted(CommandClient(server.port, HERE, TOKEN), server) for _ in range(3)]
    first = clients[0]._connection
    for client in clients:
        client.post(GetStatus())
        assert len(arrived(server)) == 1
    old = network_transport._COMMAND.pack(b"C", first._name, first._challenge, 1) + b'{"type":"reset"}'
    first._socket.send(sign(TOKEN, old))
    refused(server, 1)
    while first._number < 2:  # it is told where to go on
        assert first._take(PATIENCE) is not None
    number = clients[0].post(GetStatus())
    ((message, _),) = arrived(server)
    assert message == GetStatus(id=number)
    for client in clients:
        client.close()


def test_after_a_new_start_of_the_deck_a_client_goes_on(server, client):
    client.post(GetStatus())
    ((_, sender),) = arrived(server)
    server._listener._secret = b"another run"
    server._listener._last.clear()
    number = client.post(Switch("walk"))
    refused(server, 1)
    found = []
    while not found:
        assert client.receive(0.05) is None  # it is told to begin anew, and sends the command again
        found += server.poll()
    ((message, sender),) = found
    assert message == Switch("walk", id=number)
    server.reply(sender, Accepted(number))
    assert client.receive(PATIENCE) == Accepted(number)


def test_a_reply_that_was_recorded_is_not_believed_again(server, client):
    client.post(GetStatus())
    ((_, sender),) = arrived(server)
    server.reply(sender, Accepted(1))
    assert client.receive(PATIENCE) == Accepted(1)
    server._listener._sent = 0
    server.reply(sender, Accepted(1))
    assert client.receive(0.01) is None


def test_a_network_is_not_listened_to_without_a_token():
    with pytest.raises(SocketError, match="need a token"):
        CommandServer(0, "0.0.0.0")


def test_a_deck_with_another_token_is_not_believed(server, client):
    client.post(GetStatus())
    ((_, sender),) = arrived(server)
    server._listener._token = b"fedcba9876543210"
    server.reply(sender, Accepted(1))
    with pytest.raises(SocketError, match="another token"):
        client.receive(PATIENCE)


def test_localhost_needs_no_file_of_hosts(monkeypatch):
    def numbers_only(host, *rest, lookup=socket.getaddrinfo, **more):
        return lookup(host, *rest, flags=socket.AI_NUMERICHOST, **more)

    monkeypatch.setattr(socket, "getaddrinfo", numbers_only)
    CommandServer(0, "localhost", TOKEN).close()


@pytest.mark.parametrize(("listened", "sent"), [("0.0.0.0", HERE), ("::", "::1"), ("::1", "::1"), ("localhost", HERE)])
def test_all_addresses_of_a_kind_are_listened_to(listened, sent):
    try:
        server = CommandServer(0, listened, TOKEN)
    except SocketError as error:
        if ":" in listened:
            pytest.skip(f"no IPv6 here: {error}")
        raise
    with closing(server), closing(CommandClient(server.port, sent, TOKEN)) as client:
        if listened == "localhost" and server._listener._socket.family == socket.AF_INET6:
            pytest.skip("localhost is ::1 here")
        greeted(client, server).post(GetStatus())
        assert len(arrived(server)) == 1


@pytest.mark.parametrize(
    ("host", "port", "said"),
    [
        ("192.0.2.1", 0, "at 192.0.2.1 cannot be used.*an address of this machine"),
        ("", 0, "'' cannot be used"),
        ("no such host", 0, "'no such host' cannot be used"),
        (HERE, 70_000, "70000 at 127.0.0.1 cannot be used"),
    ],
)
def test_an_address_that_cannot_be_is_refused_with_the_reason(host, port, said):
    with pytest.raises(SocketError, match=said):
        CommandServer(port, host, TOKEN)


def test_with_no_deck_there_the_client_says_so(monkeypatch):
    monkeypatch.setattr(network_transport, "_ANSWERS_WITHIN", 0.02)
    monkeypatch.setattr(network_transport, "_HELLO_EVERY", 0.01)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind((HERE, 0))
        client = CommandClient(silent.getsockname()[1], HERE, TOKEN)
        with closing(client), pytest.raises(SocketError, match=r"no deck replies at 127\.0\.0\.1.*same token"):
            client.post(GetStatus())
