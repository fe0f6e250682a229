"""Datagrams between programs of one user on this machine: Unix sockets in a folder of mode 0700.

A deck is found by its number, which is the name of its socket; beside it is the stop door (`stop_door`), with `.stop`
behind the number. Each client (`local_connection`) has its own connection, so that one that floods or never reads
fills only its own buffer, and either side notices at once when the other is gone.
"""

import contextlib
import errno
import fcntl
import os
import random
import select
import socket
import stat
import struct
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import gettempdir

from motiondeck_base.errors import MotiondeckError

DEFAULT_PORT = 47810

STOP_DOOR = ".stop"  # what the name of the stop door has behind the number of its deck

MOST_CLIENTS = 64
FULL = f"the deck is full: {MOST_CLIENTS} programs are connected. End one; an emergency stop is taken all the same"
TURNED_AWAY = f'{{"type":"refused","reason":"{FULL}"}}'.encode()
"""The last words of a full deck on a connection that it ends."""

_REMEDY = "Set XDG_RUNTIME_DIR to a folder of your own with a short path"
_FREE_NUMBERS = range(49152, 65536)
_CREDENTIALS = struct.Struct("3i")  # process, user and group of a peer


class SocketError(MotiondeckError):
    """A socket that cannot be used, or a deck that does not reply; the message has the remedy."""


class PeerGoneError(SocketError):
    """The other side of a connection has ended, or was never there."""


def command_folder() -> Path:
    """The folder of the user's own (0700) in which decks have their sockets; it is made where it is missing.

    It is `motiondeck` in XDG_RUNTIME_DIR, else in /run/user/UID, else motiondeck-commands-UID in TMPDIR. SocketError
    if it cannot be made, or is not this user's alone.
    """
    user = os.geteuid()
    session = Path(os.environ.get("XDG_RUNTIME_DIR") or f"/run/user/{user}")
    folder = session / "motiondeck" if session.is_dir() else Path(gettempdir(), f"motiondeck-commands-{user}")
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        about = folder.lstat()
    except OSError as error:
        raise SocketError(f"{folder}: cannot be made ({error.strerror or error}). {_REMEDY}") from error
    if not stat.S_ISDIR(about.st_mode) or about.st_uid != user or about.st_mode & 0o077:
        raise SocketError(f"{folder}: others could command the deck here. Remove it, or: chmod 700 {folder}")
    return folder


class LocalSocket:
    """A listening socket in the folder of this user, under the number of a deck; it never blocks."""

    def __init__(self, port: int, ending: str, backlog: int) -> None:
        """Takes a number, 0 for any free one; SocketError if another deck has it, or the folder cannot be used."""
        check_port(port)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.setblocking(False)
        folder = command_folder()
        try:
            with _locked(folder):
                self.port = port or _free_number(folder)
                self._path = folder / f"{self.port}{ending}"
                if _answers(self._path):
                    raise _another_deck(port)
                self._path.unlink(missing_ok=True)  # of a deck that was killed
                self._socket.bind(str(self._path))
                self._socket.listen(backlog)
        except OSError as error:
            self._socket.close()
            raise SocketError(
                f"{folder}: no command socket can be made ({error.strerror or error}). {_REMEDY}"
            ) from error
        except SocketError:
            self._socket.close()
            raise
        self.number = self._socket.fileno()
        self.ready = select.epoll()  # when a program wants to connect; its owner adds connections
        self.ready.register(self._socket, select.EPOLLIN)

    def accept(self) -> socket.socket | None:
        """A connection of a program of this user or of root, or None; one of another user is closed."""
        with contextlib.suppress(OSError):
            client, _ = self._socket.accept()
            user = _CREDENTIALS.unpack(client.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size))[1]
            if user in (0, os.geteuid()):
                client.setblocking(False)
                return client
            client.close()
        return None

    def close(self, connections: Iterable[socket.socket]) -> None:
        """Closes it and its connections and removes it; may be called twice."""
        if self.ready.closed:
            return
        for one in (self.ready, *connections, self._socket):
            one.close()
        with contextlib.suppress(OSError), _locked(self._path.parent):
            if not _answers(self._path):
                self._path.unlink(missing_ok=True)


def read_datagram(connection: socket.socket, most_bytes: int) -> bytes | None:
    """A datagram that has arrived, b"" for none; None where the peer has gone, which an empty datagram looks like."""
    try:
        return connection.recv(most_bytes) or None
    except BlockingIOError:
        return b""
    except OSError:
        return None


def send_datagram(connection: socket.socket, data: bytes) -> None:
    """Sends a datagram; it is dropped if the peer's buffer is full, or the peer has gone."""
    with contextlib.suppress(OSError):
        connection.send(data)


class LocalListener:
    """Accepts connections from programs of this user; never blocks, and never raises once it is open."""

    remote = False
    replayed = unsigned = 0
    send = staticmethod(send_datagram)

    def __init__(self, port: int) -> None:
        """Takes a number, 0 for any free one; raises a SocketError if another deck has it, or it is out of range."""
        self._door = LocalSocket(port, "", MOST_CLIENTS)
        self.port = self._door.port
        self._clients: dict[int, socket.socket] = {}
        self._ready = self._door.ready

    def receive(self, most_bytes: int, limit: int) -> Iterator[tuple[bytes, socket.socket]]:
        """The datagrams that have arrived, each with its sender; clients take turns."""
        # A client that comes or goes counts as a datagram, so that no number of them makes this take long.
        while limit > 0 and (found := self._ready.poll(0)):
            limit -= len(found)
            for number, _ in found:
                if number == self._door.number:
                    self._accept()
                elif data := read_datagram(client := self._clients[number], most_bytes):
                    yield data, client
                elif data is None:
                    del self._clients[number]
                    self._ready.unregister(client)
                    client.close()

    def _accept(self) -> None:
        client = self._door.accept()
        if client is None:
            return
        if len(self._clients) < MOST_CLIENTS:
            self._clients[client.fileno()] = client
            self._ready.register(client, select.EPOLLIN)
            return
        send_datagram(client, TURNED_AWAY)
        with contextlib.suppress(OSError):
            client.shutdown(socket.SHUT_RD)
        while read_datagram(client, 1):  # what is unread when it is closed would keep it from reading why
            pass
        client.close()

    def fileno(self) -> int:
        """Readable when there is something to receive."""
        return self._ready.fileno()

    def connected(self, sender: socket.socket) -> bool:
        """Whether a sender is connected."""
        return sender.fileno() >= 0

    def close(self) -> None:
        """Ends all connections and removes the socket; may be called twice."""
        self._door.close(self._clients.values())
        self._clients.clear()


def refuse_second_deck(port: int) -> None:
    """Refuses a command port at which another deck answers: a SocketError says how to reach it or start another."""
    if port and _answers(command_folder() / str(port)):
        raise _another_deck(port)


def _another_deck(port: int) -> SocketError:
    at = "" if port == DEFAULT_PORT else f" --command-port {port}"
    return SocketError(
        f"another deck is running (command port {port}). Play on it with 'motiondeck send{at} switch MOTION', stop "
        f"it with 'motiondeck send{at} stop', or start a second one beside it with --port 0 --command-port 0"
    )


def check_port(port: int) -> None:
    """Raises a SocketError if a command port is out of range."""
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
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as probe, contextlib.suppress(OSError):
        probe.setblocking(False)
        return probe.connect_ex(str(path)) in (0, errno.EAGAIN)  # EAGAIN: more clients wait than it takes at once
    return False
