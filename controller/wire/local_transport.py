"""Datagrams between programs of one user on this machine: Unix sockets in a folder of mode 0700.

A deck is found by its number, which is the name of its socket. Each client has its own connection, so that one
that floods or never reads fills only its own buffer, and either side notices at once when the other is gone.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import random
import select
import socket
import stat
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from motiondeck_base.errors import MotiondeckError

DEFAULT_PORT = 47810

MOST_CLIENTS = 64
RESERVED = 16  # further connections, of which only an emergency stop is taken
_FREE_NUMBERS = range(49152, 65536)
_CREDENTIALS = struct.Struct("3i")  # process, user and group of a peer

T = TypeVar("T")


class SocketError(MotiondeckError):
    """A socket that cannot be used, or a deck that does not reply; the message has the remedy."""


class PeerGoneError(SocketError):
    """The other side of a connection has ended, or was never there."""


def command_folder() -> Path:
    """The folder of the user's own (0700) in which decks have their sockets; it is made where it is missing.

    It is `motiondeck` in XDG_RUNTIME_DIR, else in /run/user/UID, else /tmp/motiondeck-commands-UID.

    Raises:
        SocketError: if it cannot be made, or is not this user's alone.
    """
    user = os.geteuid()
    session = Path(os.environ.get("XDG_RUNTIME_DIR") or f"/run/user/{user}")
    folder = session / "motiondeck" if session.is_dir() else Path(f"/tmp/motiondeck-commands-{user}")
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        about = folder.lstat()
    except OSError as error:
        raise SocketError(
            f"{folder}: the folder for command sockets cannot be made ({error.strerror or error}). "
            "Set XDG_RUNTIME_DIR to a folder of your own"
        ) from error
    if not stat.S_ISDIR(about.st_mode) or about.st_uid != user or about.st_mode & 0o077:
        raise SocketError(
            f"{folder}: others could command the deck here. Remove it, or forbid that with: chmod 700 {folder}"
        )
    return folder


class LocalClient:
    """A program that is connected to a deck; in a reserved place it may give an emergency stop only."""

    def __init__(self, connection: socket.socket, reserved: bool) -> None:
        self.connection, self.reserved = connection, reserved


class LocalListener:
    """Accepts connections from programs of this user; never blocks, and never raises once it is open."""

    remote = False

    def __init__(self, port: int, full: bytes) -> None:
        """Takes a number, 0 for any free one; raises a SocketError if another deck has it, or it is out of range.

        Args:
            full: what a program reads that has to leave its reserved place to a later one.
        """
        _check(port)
        self._full = full
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.setblocking(False)
        self._clients: dict[int, LocalClient] = {}
        self._reserved: list[LocalClient] = []  # the longest connected first
        folder = command_folder()
        try:
            with _locked(folder):
                self.port = port or _free_number(folder)
                self._path = folder / str(self.port)
                if _answers(self._path):
                    raise _another_deck(port)
                self._path.unlink(missing_ok=True)  # of a deck that was killed
                self._socket.bind(str(self._path))
                self._socket.listen(MOST_CLIENTS)
        except OSError as error:
            self._socket.close()
            raise SocketError(f"{folder}: no command socket can be made ({error.strerror or error})") from error
        except SocketError:
            self._socket.close()
            raise
        self._ready = select.epoll()
        self._ready.register(self._socket, select.EPOLLIN)

    def receive(self, most_bytes: int, limit: int) -> Iterator[tuple[bytes, LocalClient]]:
        """The datagrams that have arrived, each with its sender; clients take turns.

        A client that comes or goes counts as a datagram, so that no number of them makes this take long.
        """
        while limit > 0 and (found := self._ready.poll(0)):
            limit -= len(found)
            for number, _ in found:
                if number == self._socket.fileno():
                    self._accept()
                elif data := self._read(client := self._clients[number], most_bytes):
                    yield data, client
            while len(self._reserved) > RESERVED:
                yield from self._dismiss(self._reserved[0], most_bytes)

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            client, _ = self._socket.accept()
            client.setblocking(False)
            user = _CREDENTIALS.unpack(client.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size))[1]
            if user not in (0, os.geteuid()):
                client.close()
                return
            place = LocalClient(client, len(self._clients) - len(self._reserved) >= MOST_CLIENTS)
            self._clients[client.fileno()] = place
            if place.reserved:
                self._reserved.append(place)
            self._ready.register(client, select.EPOLLIN)

    def _read(self, client: LocalClient, most_bytes: int) -> bytes:
        """A datagram of a client; nothing where it has gone. An empty datagram looks the same, and ends it too."""
        try:
            if data := client.connection.recv(most_bytes):
                return data
        except BlockingIOError:
            return b""
        except OSError:
            pass
        self._drop(client)
        return b""

    def _dismiss(self, client: LocalClient, most_bytes: int) -> Iterator[tuple[bytes, LocalClient]]:
        """Drops a client, after all that it has sent is read: an emergency stop is not lost with its connection."""
        self.send(client, self._full)
        with contextlib.suppress(OSError):
            client.connection.shutdown(socket.SHUT_RD)  # from here on it knows that what it sends does not arrive
        while data := self._read(client, most_bytes):
            yield data, client
        if self.connected(client):
            self._drop(client)

    def _drop(self, client: LocalClient) -> None:
        """Ends a connection; whoever has waited longest in a reserved place takes an ordinary one that gets free."""
        del self._clients[client.connection.fileno()]
        if client.reserved:
            self._reserved.remove(client)
        elif self._reserved:
            self._reserved.pop(0).reserved = False
        self._ready.unregister(client.connection)
        client.connection.close()

    def fileno(self) -> int:
        """Readable when there is something to receive."""
        return self._ready.fileno()

    def connected(self, sender: LocalClient) -> bool:
        """Whether a sender is connected."""
        return sender.connection.fileno() >= 0

    def send(self, receiver: LocalClient, data: bytes) -> None:
        """Sends a datagram; it is dropped if the receiver's buffer is full."""
        with contextlib.suppress(OSError):
            receiver.connection.send(data)

    def close(self) -> None:
        """Ends all connections and removes the socket; may be called twice."""
        if self._ready.closed:
            return
        self._ready.close()
        for client in self._clients.values():
            client.connection.close()
        self._clients.clear()
        self._socket.close()
        with contextlib.suppress(OSError), _locked(self._path.parent):
            if not _answers(self._path):
                self._path.unlink(missing_ok=True)


class LocalConnection:
    """A client's connection to a deck of this user; made when something is sent."""

    def __init__(self, port: int, patience: float) -> None:
        """Prepares to talk to the deck of a number, which may keep a sender waiting for `patience` seconds.

        Raises:
            SocketError: if it is out of range.
        """
        _check(port)
        self._port, self._patience = port, patience
        self._socket: socket.socket | None = None

    def send(self, data: bytes) -> None:
        """Sends a datagram; it waits for room, as long as its patience lasts, and connects where it is not connected.

        Raises:
            PeerGoneError: if no deck is running there.
            SocketError: if it takes nothing.
        """
        if self._socket is not None:
            self._socket.settimeout(self._patience)
            with contextlib.suppress(PeerGoneError):
                self._attempt(self._socket.send, data)
                return
            self.close()  # the deck has ended, or needed the place for others
        path = command_folder() / str(self._port)
        fresh = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        fresh.settimeout(self._patience)
        try:
            self._attempt(fresh.connect, str(path))
        except SocketError:
            fresh.close()
            raise
        self._socket = fresh
        self._attempt(fresh.send, data)

    def _attempt(self, act: Callable[[T], object], given: T) -> None:
        try:
            act(given)
        except (TimeoutError, BlockingIOError):
            raise self._held_up() from None
        except OSError:
            raise self._not_running() from None

    def receive(self, timeout_s: float) -> bytes | None:
        """The next datagram, or None if none arrives in time; without any time it does not wait at all.

        Raises:
            PeerGoneError: if no deck is running there.
        """
        if self._socket is None:
            raise self._not_running()
        # Any time above 0 becomes at least a millisecond, in which a loop would give up its core.
        self._socket.settimeout(max(timeout_s, 0.0))
        try:
            if data := self._socket.recv(65536):
                return data
        except (TimeoutError, BlockingIOError):
            return None
        except OSError:
            pass
        self.close()
        raise self._not_running()

    def fileno(self) -> int:
        """Readable when there is something to receive; raises a PeerGoneError if it is not connected."""
        if self._socket is None:
            raise self._not_running()
        return self._socket.fileno()

    def close(self) -> None:
        """Closes the connection; may be called twice."""
        if self._socket is not None:
            self._socket.close()
        self._socket = None

    def _held_up(self) -> SocketError:
        return SocketError(f"the deck on port {self._port} takes no commands: it is held up")

    def _not_running(self) -> PeerGoneError:
        return PeerGoneError(f"no deck is running on port {self._port}; start one with: motiondeck play")


def refuse_second_deck(port: int) -> None:
    """Refuses a command port that another deck has; nothing is taken.

    Raises:
        SocketError: if a deck answers there; it says how to reach that one and how to start another beside it.
    """
    if port and _answers(command_folder() / str(port)):
        raise _another_deck(port)


def _another_deck(port: int) -> SocketError:
    at = "" if port == DEFAULT_PORT else f" --command-port {port}"
    return SocketError(
        f"another deck is running (command port {port}). Play on it with 'motiondeck send{at} switch MOTION', stop "
        f"it with 'motiondeck send{at} stop', or start a second one beside it with --port 0 --command-port 0"
    )


def _check(port: int) -> None:
    if not 0 <= port < 1 << 16:
        raise SocketError(f"command port {port} cannot be used: it must be from 0 to 65535")


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    lock = os.open(folder / "lock", os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)


def _free_number(folder: Path) -> int:
    # Random, so that the number of a deck that has ended is not reused soon.
    while (folder / str(number := random.choice(_FREE_NUMBERS))).exists():
        pass
    return number


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as probe:
        probe.setblocking(False)
        try:
            probe.connect(str(path))
        except BlockingIOError:  # more clients wait than it takes at once
            return True
        except OSError:
            return False
    return True
