"""Signed datagrams over a network: UDP, a secret token, and numbers that make a recorded datagram worthless.

    client:  hello                     H | client
    deck:    challenge                 K | client | challenge | number
    client:  command                   C | client | challenge | number | JSON
    deck:    reply                     R | client | number | JSON

Each is preceded by its HMAC-SHA256 with the token. `client` is chosen by chance by each client. The challenge is an
HMAC of it with a secret that the deck makes when it starts, so that no command of another run is taken. The numbers of
a client must rise from one command to the next, those of replies too. The deck knows the last number of the clients
that it has heard from most recently; of all others only numbers above those it has forgotten are taken, and it tells
them where to begin. Nothing is encrypted.
"""

import contextlib
import hashlib
import hmac
import os
import socket
import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from controller.wire.authentication import SIGNATURE_BYTES, sign, verify
from controller.wire.local_transport import PeerGoneError, SocketError

_HELLO = struct.Struct(">c8s")
_CHALLENGE = _COMMAND = struct.Struct(">c8s16sQ")
_REPLY = struct.Struct(">c8sQ")
OVERHEAD = SIGNATURE_BYTES + _COMMAND.size
MOST_CLIENTS = 32
_HELLO_EVERY = 0.02  # s: one of three does not come back where a fifth is lost, and a stop must not wait for it
_ANSWERS_WITHIN = 1.0  # s


@dataclass(frozen=True)
class RemoteClient:
    """A client on another machine: what it calls itself, by which it is known, and where it was heard from."""

    name: bytes
    address: Any = field(compare=False)


class NetworkListener:
    """Takes signed commands at an address of this machine; never blocks, and never raises once it is open."""

    remote = True

    def __init__(self, port: int, host: str, token: bytes) -> None:
        """Listens at an address, IPv4 or IPv6, or at all of one kind: 0.0.0.0 or ::. Port 0 takes a free one.

        SocketError if the address is not this machine's, or the port is in use or out of range.
        """
        family, address = _resolve(host, port, "cannot be used")
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            if family == socket.AF_INET6:
                self._socket.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            self._socket.bind(address)
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise SocketError(
                f"command port {port} at {host} cannot be used ({_why(error)}): give an address of this machine "
                "and a port that nothing else has"
            ) from error
        self._socket.setblocking(False)
        self._token, self._secret = token, os.urandom(32)
        self._last: dict[bytes, int] = {}  # of the clients heard from most recently, in that order
        self._floor = self._highest = self._sent = 0
        self.port: int = self._socket.getsockname()[1]
        self.replayed = 0  # datagrams, truly signed, that were sent before or to another run; none was carried out
        self.unsigned = 0  # datagrams without a true signature

    def receive(self, most_bytes: int, limit: int) -> Iterator[tuple[bytes, RemoteClient]]:
        """The commands among the datagrams that have arrived, at most `limit` of these, each with its sender."""
        for _ in range(limit):
            try:
                data, address = self._socket.recvfrom(most_bytes + OVERHEAD)
            except BlockingIOError:
                return
            except OSError:  # an earlier reply was undeliverable
                continue
            body = verify(self._token, data)
            if body is None:
                self.unsigned += 1
            elif len(body) == _HELLO.size and body[:1] == b"H":
                self._challenge(body[1:], address)
            elif len(body) >= _COMMAND.size and body[:1] == b"C":
                _, name, challenge, number = _COMMAND.unpack_from(body)
                if self._is_fresh(name, challenge, number):
                    yield body[_COMMAND.size :], RemoteClient(name, address)
                else:
                    self.replayed += 1
                    if name not in self._last:  # it was forgotten, or the deck has started anew
                        self._challenge(name, address)
            else:
                self.unsigned += 1

    def fileno(self) -> int:
        """Readable when there is something to receive."""
        return self._socket.fileno()

    def connected(self, sender: RemoteClient) -> bool:
        """Always true: nothing tells that a sender over a network is gone."""
        return True

    def send(self, receiver: RemoteClient, data: bytes) -> None:
        """Sends a reply; one that cannot be sent at once is dropped."""
        self._sent += 1
        self._send(_REPLY.pack(b"R", receiver.name, self._sent) + data, receiver.address)

    def close(self) -> None:
        """Closes the port; may be called twice."""
        self._socket.close()

    def _is_fresh(self, name: bytes, challenge: bytes, number: int) -> bool:
        """Whether a command is of this run and newer than the client's last one; it then is its last one."""
        if not hmac.compare_digest(challenge, self._expected(name)) or number <= self._last.get(name, self._floor):
            return False
        self._last.pop(name, None)
        self._last[name] = number
        self._highest = max(self._highest, number)
        if len(self._last) > MOST_CLIENTS:
            self._floor = max(self._floor, self._last.pop(next(iter(self._last))))
        return True

    def _challenge(self, name: bytes, address: Any) -> None:
        self._send(_CHALLENGE.pack(b"K", name, self._expected(name), self._highest + 1), address)

    def _expected(self, name: bytes) -> bytes:
        return hmac.digest(self._secret, name, hashlib.sha256)[:16]

    def _send(self, body: bytes, address: Any) -> None:
        with contextlib.suppress(OSError):
            self._socket.sendto(sign(self._token, body), address)


class NetworkConnection:
    """A client's way to a deck on another machine; it asks for a challenge when something is first sent."""

    def __init__(self, port: int, host: str, token: bytes) -> None:
        """Prepares to talk to the deck at an address and port; raises a SocketError if they cannot exist."""
        self._port, self._host, self._token = port, host, token
        family, address = _resolve(host, port, "cannot be reached")
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            self._socket.connect(address)
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise SocketError(f"a deck at {host}, port {port} cannot be reached ({_why(error)})") from error
        self._name = os.urandom(8)
        self._challenge = b""
        self._number = self._heard = 0
        self._pending = b""  # the last command, to be sent again if the deck had another challenge for us

    def send(self, data: bytes) -> None:
        """Sends a command; raises a PeerGoneError if no deck replies there."""
        deadline = time.monotonic() + _ANSWERS_WITHIN
        while not self._challenge and time.monotonic() < deadline:
            self._put_body(_HELLO.pack(b"H", self._name))
            self._take(_HELLO_EVERY)
        if not self._challenge:
            raise self._nobody()
        self._pending = data
        self._put()

    def receive(self, timeout_s: float) -> bytes | None:
        """The next reply, or None if none comes in time; PeerGoneError without a deck, SocketError if tokens differ."""
        deadline = time.monotonic() + timeout_s
        while (body := self._take(deadline - time.monotonic())) is not None:
            if body[:1] == b"K" and self._pending:  # the deck has started anew, or forgotten us
                self._put()
                self._pending = b""
            elif body[:1] == b"R":
                self._pending = b""
                return body[_REPLY.size :]
        return None

    def fileno(self) -> int:
        """Readable when there is something to receive."""
        return self._socket.fileno()

    def close(self) -> None:
        """Closes the socket; may be called twice."""
        self._socket.close()

    def _put(self) -> None:
        self._number += 1
        self._put_body(_COMMAND.pack(b"C", self._name, self._challenge, self._number) + self._pending)

    def _put_body(self, body: bytes) -> None:
        try:
            self._socket.send(sign(self._token, body))
        except OSError:  # reported for an earlier datagram; this one was not sent
            raise self._nobody() from None

    def _take(self, timeout_s: float) -> bytes | None:
        """The next datagram for us; a challenge is taken note of, and an old reply passed over."""
        self._socket.settimeout(max(timeout_s, 0.0))
        try:
            body = verify(self._token, self._socket.recv(65536))
        except (TimeoutError, BlockingIOError):
            return None
        except OSError:
            raise self._nobody() from None
        if body is None:
            raise SocketError(f"the deck at {self._host} uses another token; give --token-file its own")
        if body[1:9] != self._name:
            return b""
        if body[:1] == b"K" and len(body) == _CHALLENGE.size:
            _, _, self._challenge, number = _CHALLENGE.unpack(body)
            self._number = max(self._number, number)
        elif body[:1] == b"R" and len(body) >= _REPLY.size:
            number = _REPLY.unpack_from(body)[2]
            if number <= self._heard:
                return b""
            self._heard = number
        return body

    def _nobody(self) -> PeerGoneError:
        return PeerGoneError(
            f"no deck replies at {self._host}, port {self._port}: was it started with --listen and the same token?"
        )


def _resolve(host: str, port: int, fails: str) -> tuple[socket.AddressFamily, Any]:
    """The kind of an address, and the address as sockets take it."""
    if not 0 <= port < 1 << 16:
        raise SocketError(f"command port {port} at {host} {fails}: it must be from 0 to 65535")
    if host == "localhost":
        host = "127.0.0.1"  # also where no file of hosts says so (RFC 6761, section 6.3)
    try:
        family, _, _, _, address = socket.getaddrinfo(host or " ", port, type=socket.SOCK_DGRAM)[0]
    except (OSError, UnicodeError) as error:
        raise SocketError(f"'{host}' {fails} ({_why(error)}): give the address of a machine") from None
    return family, address


def _why(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
