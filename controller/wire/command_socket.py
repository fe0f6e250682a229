"""Commands over a socket: UDP datagrams on the loopback interface, for a loop that never waits.

On another interface every datagram must be signed with a token, in both directions; others are dropped unanswered.

A datagram arrives whole or not at all, so that a slow or broken client has no connection to stall. Datagrams are read
in bounded amounts; those that are not commands are counted and, up to a limit, refused.
"""

from __future__ import annotations

import contextlib
import itertools
import socket
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import msgspec

from controller.wire.authentication import SIGNATURE_BYTES, sign, verify
from controller.wire.command_table import read_message
from controller.wire.messages import (
    MOST_BYTES,
    CommandError,
    EmergencyStop,
    Message,
    Number,
    Refused,
    Reply,
    Settled,
    encode,
    read_reply,
)
from motiondeck_base.errors import MotiondeckError

DEFAULT_PORT = 47810
LOOPBACK = "127.0.0.1"

_PER_SENDER = 8  # commands of one sender that are carried out in one poll
_REFUSALS = 8  # refusals of malformed datagrams in one poll: each costs as much as a command
_TAKEN = 320  # datagrams read from the system in one poll
_WAITING = 256  # datagrams kept for later polls

Address = tuple[str, int]


class SocketError(MotiondeckError):
    """A port that cannot be used, or a deck that does not reply; the message has the remedy."""


@dataclass
class Traffic:
    """Counts of a server: commands passed on, malformed datagrams, and commands beyond a sender's limit."""

    commands: int = 0
    malformed: int = 0
    flooded: int = 0


class CommandServer:
    """Receives commands on a port; never blocks, and never raises once it is open.

    Attributes:
        port: the port it listens on.
        traffic: counts of what has arrived.
    """

    def __init__(self, port: int = DEFAULT_PORT, host: str = LOOPBACK, token: bytes | None = None) -> None:
        """Listens on 127.0.0.1, or with a token on another interface too; port 0 takes a free one.

        Raises:
            SocketError: if the port is in use or out of range, or another interface is given without a token.
        """
        if host != LOOPBACK and token is None:
            raise SocketError(f"commands on {host} need a token; give one with --token-file FILE")
        self._token = token
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise SocketError(
                f"command port {port} on {host} cannot be used ({_why(error)}): perhaps another deck is running. "
                "Stop it with 'motiondeck send stop', or give another port with --command-port"
            ) from error
        self._socket.setblocking(False)
        self._waiting: deque[tuple[bytes, Address]] = deque()
        self.port: int = self._socket.getsockname()[1]
        self.traffic = Traffic()

    def poll(self, limit: int = 64) -> Iterator[tuple[Message, Address]]:
        """The commands among the next `limit` datagrams, each with its sender; an emergency stop comes first."""
        self._take()
        share: dict[Address, int] = {}
        refusals = 0
        for _ in range(min(limit, len(self._waiting))):
            data, sender = self._waiting.popleft()
            reason = ""
            try:
                message = read_message(data)
            except CommandError as error:
                self.traffic.malformed += 1
                reason = str(error)
            else:
                share[sender] = share.get(sender, 0) + 1
                if share[sender] <= _PER_SENDER or isinstance(message, EmergencyStop):
                    self.traffic.commands += 1
                    yield message, sender
                    continue
                self.traffic.flooded += 1
                reason = "too many commands at once"
            if refusals < _REFUSALS:
                refusals += 1
                self.reply(sender, Refused(reason, _number_in(data)))

    def _take(self) -> None:
        """Reads what has arrived, an emergency stop to the front; what exceeds the limits is dropped and counted."""
        for _ in range(_TAKEN):
            try:
                data, sender = self._socket.recvfrom(SIGNATURE_BYTES + MOST_BYTES + 1)
            except BlockingIOError:
                return
            except OSError:  # an earlier reply reached nobody
                continue
            if self._token is not None:
                data = verify(self._token, data)
                if data is None:
                    self.traffic.malformed += 1
                    continue
            if b'"estop"' in data:
                self._waiting.appendleft((data, sender))
            else:
                self._waiting.append((data, sender))
            if len(self._waiting) > _WAITING:
                self._waiting.pop()
                self.traffic.flooded += 1

    def reply(self, receiver: Address, reply: Reply) -> None:
        """Sends a reply; one that cannot be sent at once is dropped."""
        data = encode(reply)
        with contextlib.suppress(OSError):
            self._socket.sendto(data if self._token is None else sign(self._token, data), receiver)

    def close(self) -> None:
        """Closes the port; may be called twice."""
        self._socket.close()


class CommandClient:
    """Sends commands to a deck on this machine, or with a token to one on another."""

    def __init__(self, port: int = DEFAULT_PORT, host: str = LOOPBACK, token: bytes | None = None) -> None:
        """Prepares to talk to the deck at a port; nothing is sent yet.

        Raises:
            SocketError: if the address or port cannot exist.
        """
        self._port, self._host, self._token = port, host, token
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.connect((host, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise SocketError(f"a deck at {host}, port {port} cannot be reached ({_why(error)})") from error
        self._numbers = itertools.count(1)
        self._settled: dict[int, Settled | Refused] = {}

    def post(self, message: Message) -> int:
        """Sends a command without waiting; returns the number that its replies will carry.

        Raises:
            SocketError: if no deck is running there.
        """
        number = next(self._numbers)
        data = encode(msgspec.structs.replace(message, id=number))
        if self._token is not None:
            data = sign(self._token, data)
        try:
            self._socket.send(data)
        except ConnectionRefusedError:  # reported for an earlier datagram; this one was not sent
            raise self._no_deck() from None
        return number

    def request(self, message: Message, timeout_s: float = 1.0) -> Reply:
        """Sends a command and waits for its first reply.

        Raises:
            SocketError: if no deck replies in time.
        """
        number = self.post(message)
        deadline = time.monotonic() + timeout_s
        while reply := self.receive(deadline - time.monotonic()):
            if reply.id == number:
                return reply
            if isinstance(reply, Settled):
                self._settled[reply.id] = reply
        raise self._no_deck()

    def wait_settled(self, number: int, timeout_s: float = 10.0) -> Settled | Refused | None:
        """Waits until the switch with this number has settled or was overtaken; None if neither happens in time.

        Raises:
            SocketError: if the deck is gone.
        """
        deadline = time.monotonic() + timeout_s
        while number not in self._settled:
            reply = self.receive(deadline - time.monotonic())
            if reply is None:
                return None
            if isinstance(reply, (Settled, Refused)):
                self._settled[reply.id] = reply
        return self._settled.pop(number)

    def receive(self, timeout_s: float) -> Reply | None:
        """The next reply, to any command, or None if none arrives in time.

        Raises:
            SocketError: if no deck is running there.
        """
        self._socket.settimeout(max(timeout_s, 1e-6))
        try:
            data = self._socket.recv(65536)
            if self._token is not None and (data := verify(self._token, data)) is None:
                raise SocketError(f"the deck at {self._host} uses another token")
            return read_reply(data)
        except TimeoutError:
            return None
        except ConnectionRefusedError:
            raise self._no_deck() from None

    def close(self) -> None:
        """Closes the socket; may be called twice."""
        self._socket.close()

    def _no_deck(self) -> SocketError:
        if self._token is not None:
            return SocketError(
                f"no deck replies at {self._host}, port {self._port}: was it started with --listen and the same token?"
            )
        return SocketError(f"no deck is running on port {self._port}; start one with: motiondeck play")


class _Numbered(msgspec.Struct):
    id: Number = 0


_numbered = msgspec.json.Decoder(_Numbered)


def _number_in(data: bytes) -> int:
    """The number of a command that cannot be read otherwise, or 0."""
    try:
        return _numbered.decode(data).id
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return 0


def _why(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
