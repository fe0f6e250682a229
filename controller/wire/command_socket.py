"""Commands over sockets: datagrams for a loop that never waits.

Programs of the same user reach a deck over a Unix socket (`local_transport`); others, where that is wanted, over a
network with signed datagrams (`network_transport`). Both are read in bounded amounts; datagrams that are not commands
are counted and, up to a limit, refused.
"""

import itertools
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import msgspec

from controller.wire.local_connection import LocalConnection
from controller.wire.local_transport import DEFAULT_PORT, LocalListener, PeerGoneError, SocketError
from controller.wire.messages.arguments import CommandError
from controller.wire.messages.command_table import number_in, read_command, usages
from controller.wire.messages.commands import MOST_BYTES, DeckCommand, EmergencyStop, encode
from controller.wire.messages.replies import Refused, Reply, SecondReply, read_reply
from controller.wire.network_transport import NetworkConnection, NetworkListener

__all__ = ["DEFAULT_PORT", "Address", "CommandClient", "CommandServer", "SocketError", "Traffic"]

_PER_SENDER = 8  # commands per sender and poll
_LINE = 32  # further commands of a sender that queue for the next polls; beyond that they are refused
_REFUSALS = 8  # refusals of malformed datagrams in one poll: each costs as much as a command
_TAKEN = 320  # datagrams received in one poll
_WAITING = 256  # datagrams kept for later polls
_STOP_AGAIN, _STOP_FOR = 0.02, 5.0  # s: how often, and for how long, an unanswered stop over a network is sent
_STOPPED_WITHIN = 0.5  # s in which a stop of a deck of this user is answered
_UNSTOPPED = "the emergency stop is not acknowledged: the deck has ended, or hangs. If the robot moves, cut its power"
_REMEMBERED = 256  # second replies that a client keeps for `wait_settled`

T = TypeVar("T")

Address = Hashable  # identifies a sender


@dataclass
class Traffic:
    """Counts of a server: commands passed on, malformed datagrams, commands beyond a sender's limit, replayed ones."""

    commands: int = 0
    malformed: int = 0
    flooded: int = 0
    replayed: int = 0


class CommandServer:
    """Receives commands; never blocks, and never raises once it is open."""

    def __init__(self, port: int = DEFAULT_PORT, host: str | None = None, token: bytes | None = None) -> None:
        """Listens to programs of this user, or with a token at an address of this machine; port 0 takes a free one.

        SocketError if the port is in use or out of range, or an address is given without a token.
        """
        if host is None:
            self._listener = LocalListener(port)
        elif token is None:
            raise SocketError(f"commands at {host} need a token; give one with --token-file FILE")
        else:
            self._listener = NetworkListener(port, host, token)
        usages()  # before a loop runs, in which it would make a tick late
        self._waiting: deque[tuple[bytes, Address]] = deque()
        self._queued: dict[Address, deque[bytes]] = {}  # empty ones are taken out
        self._refusals = 0  # in this poll
        self._traffic = Traffic()
        self.port, self.remote = self._listener.port, self._listener.remote

    @property
    def traffic(self) -> Traffic:
        """Counts of what has arrived."""
        counts, listener = self._traffic, self._listener
        return Traffic(counts.commands, counts.malformed + listener.unsigned, counts.flooded, listener.replayed)

    def poll(self, limit: int = 64) -> Iterator[tuple[DeckCommand, Address]]:
        """The commands among the next `limit` datagrams, each with its sender; an emergency stop comes first."""
        # Per sender a few are taken in a poll, and some more queue for the next polls.
        self._refusals = 0
        self._take()
        if not (self._waiting or self._queued):
            return
        share: Counter[Address] = Counter()
        for _ in range(min(limit, len(self._waiting))):
            data, sender = self._waiting.popleft()
            if (sender in self._queued or share[sender] >= _PER_SENDER) and not _is_stop(data):
                self._enqueue(data, sender)
            elif (message := self._read(data, sender)) is not None:
                share[sender] += 1
                yield message, sender
        for sender, line in list(self._queued.items()):
            while line and share[sender] < _PER_SENDER:
                share[sender] += 1
                if (message := self._read(line.popleft(), sender)) is not None:
                    yield message, sender
            if not line:
                del self._queued[sender]

    def _enqueue(self, data: bytes, sender: Address) -> None:
        line = self._queued.setdefault(sender, deque())
        if len(line) < _LINE:
            line.append(data)
            return
        self._traffic.flooded += 1
        self._refuse(data, sender, "too many commands at once")

    def _read(self, data: bytes, sender: Address) -> DeckCommand | None:
        """The command in a datagram; None, and a refusal is sent, if it has none."""
        try:
            message = read_command(data)
        except CommandError as error:
            self._traffic.malformed += 1
            self._refuse(data, sender, str(error))
            return None
        self._traffic.commands += 1
        return message

    def _refuse(self, data: bytes, sender: Address, reason: str) -> None:
        self._refusals += 1
        if self._refusals <= _REFUSALS:
            self.reply(sender, Refused(reason, number_in(data)))

    def _take(self) -> None:
        """Reads what has arrived, an emergency stop to the front; what exceeds the limits is dropped and counted."""
        for datagram in self._listener.receive(MOST_BYTES + 1, _TAKEN):
            if b'"estop"' in datagram[0]:
                self._waiting.appendleft(datagram)
            else:
                self._waiting.append(datagram)
            if len(self._waiting) > _WAITING:
                self._waiting.pop()
                self._traffic.flooded += 1

    def fileno(self) -> int:
        """Readable when something has arrived, for `select`."""
        return self._listener.fileno()

    def connected(self, sender: Address) -> bool:
        """Whether a sender is connected, as far as that is known."""
        return self._listener.connected(sender)  # pyright: ignore[reportArgumentType] (from this listener)

    def reply(self, receiver: Address, reply: Reply) -> None:
        """Sends a reply; one that cannot be sent at once is dropped."""
        self._listener.send(receiver, encode(reply))  # pyright: ignore[reportArgumentType] (from this listener)

    def close(self) -> None:
        """Closes the socket; may be called twice."""
        self._listener.close()


@dataclass
class _UnansweredStop:
    """An emergency stop over a network, with its number."""

    number: int
    data: bytes
    posted: float  # s
    sent: float  # the last time, s


class CommandClient:
    """Sends commands to a deck of this user, or with a token to one at an address.

    Threads may share a client of a deck of this user: each reply goes to the one that waits for its number.
    """

    def __init__(
        self, port: int = DEFAULT_PORT, host: str | None = None, token: bytes | None = None, patience: float = 1.0
    ) -> None:
        """Prepares to talk to a deck; nothing is sent yet. SocketError if the address or port cannot exist.

        A command waits up to `patience`, s, for a deck of this user that takes none at the moment.
        """
        self._connection = (
            LocalConnection(port, patience) if host is None or token is None else NetworkConnection(port, host, token)
        )
        self._numbers = itertools.count(1)
        self._requested: dict[int, Reply | None] = {}  # the first replies to requests under way, as they come
        self._settled: dict[int, SecondReply] = {}
        self._filed = threading.Condition()
        self._reading = False  # whether one of the threads that wait reads for all
        self._stop: _UnansweredStop | None = None

    def post(self, message: DeckCommand) -> int:
        """Sends a command without waiting for a reply; returns the number that its replies will carry.

        An emergency stop of a deck of this user goes to its stop door. SocketError if no deck is running there, or it
        is full or takes no commands.
        """
        self._send(message, number := next(self._numbers))
        return number

    def _send(self, message: DeckCommand, number: int) -> None:
        data = encode(msgspec.structs.replace(message, id=number))
        if not isinstance(message, EmergencyStop):
            self._connection.send(data)
        elif isinstance(self._connection, LocalConnection):
            self._connection.send_stop(data)
        else:
            self._connection.send(data)
            now = time.monotonic()
            self._stop = _UnansweredStop(number, data, posted=now, sent=now)

    def request(self, message: DeckCommand, timeout_s: float = 1.0) -> Reply:
        """Sends a command and waits for its first reply, to an emergency stop of a deck of this user for 0.5 s at most.

        SocketError if no deck replies in time.
        """
        stops = isinstance(message, EmergencyStop)
        if stops and isinstance(self._connection, LocalConnection):
            timeout_s = min(timeout_s, _STOPPED_WITHIN)
        until, number = time.monotonic() + timeout_s, next(self._numbers)
        with self._filed:
            self._requested[number] = None
        try:
            self._send(message, number)
            reply = self._wait_for(lambda: self._requested[number], until)
        finally:
            with self._filed:
                del self._requested[number]
        if reply is None:
            raise PeerGoneError(_UNSTOPPED if stops else "the deck does not reply: it has ended, or is held up")
        return reply

    def wait_settled(self, number: int, timeout_s: float = 10.0) -> SecondReply | None:
        """The second reply to the command with this number; None if none comes in time, SocketError without a deck."""
        return self._wait_for(lambda: self._settled.get(number), time.monotonic() + timeout_s)

    def _wait_for(self, reply: Callable[[], T | None], until: float) -> T | None:
        """Waits for a reply to be filed; of the threads that wait, one reads, and files what comes for all."""
        with self._filed:
            while (found := reply()) is None:
                left = until - time.monotonic()
                more = self._filed.wait(left) if self._reading else self._read_for_all(left)
                if not more and time.monotonic() >= until:
                    return reply()
            return found

    def _read_for_all(self, timeout_s: float) -> bool:
        """Reads a reply with the lock of `_filed` held, while others may send or wait; whether one has arrived."""
        self._reading = True
        self._filed.release()
        try:
            arrived = self.receive(timeout_s)
        finally:
            self._filed.acquire()
            self._reading = False
            self._filed.notify_all()
        if arrived is not None:
            self._file(arrived)
        return arrived is not None

    def _file(self, reply: Reply) -> None:
        waiting = [number for number, first in self._requested.items() if first is None]
        if reply.id in waiting:
            self._requested[reply.id] = reply
        elif isinstance(reply, Refused) and not reply.id and waiting:  # it could not be read
            self._requested[waiting[0]] = reply
        elif isinstance(reply, SecondReply):
            self._settled[reply.id] = reply
            if len(self._settled) > _REMEMBERED:
                del self._settled[next(iter(self._settled))]

    def receive(self, timeout_s: float) -> Reply | None:
        """The next reply, to any command, or None if none arrives in time.

        An emergency stop over a network is sent again meanwhile, with its number, until it is answered or 5 s old.
        SocketError if no deck is running there, or it is full.
        """
        data = self._receive_answer(timeout_s) if self._stop is not None else self._connection.receive(timeout_s)
        if data is None:
            return None
        reply = read_reply(data)
        if self._stop is not None and reply.id == self._stop.number:
            self._stop = None
        return reply

    def _receive_answer(self, timeout_s: float) -> bytes | None:
        """What arrives in time, while a stop is not answered: datagrams are lost."""
        deadline = time.monotonic() + timeout_s
        while (stop := self._stop) is not None:
            now = time.monotonic()
            if now > stop.posted + _STOP_FOR:
                self._stop = None
            elif now >= stop.sent + _STOP_AGAIN:
                self._connection.send(stop.data)
                stop.sent = now
            data = self._connection.receive(min(deadline, stop.sent + _STOP_AGAIN) - now)
            if data is not None or time.monotonic() >= deadline:
                return data
        return self._connection.receive(deadline - time.monotonic())

    def fileno(self) -> int:
        """Readable when a reply has arrived, for `select`, once a command was sent; SocketError if no deck is there."""
        return self._connection.fileno()

    def close(self) -> None:
        """Closes the socket; may be called twice."""
        self._connection.close()


def _is_stop(data: bytes) -> bool:
    try:
        return b'"estop"' in data and isinstance(read_command(data), EmergencyStop)
    except CommandError:
        return False
