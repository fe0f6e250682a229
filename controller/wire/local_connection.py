"""A client's way to a deck of this user: a connection for commands, and one to the stop door."""

import select
import socket
import struct
import threading
import time
from collections.abc import Callable
from typing import TypeVar

from controller.wire import local_transport as transport
from controller.wire.local_transport import PeerGoneError, SocketError

_STOP_PATIENCE = 0.2  # s that an emergency stop waits for room, at the door and then at the socket for commands
_MOST_BYTES = 65536  # of a reply
_TIME = struct.Struct("ll")  # s and us, of a timeout

T = TypeVar("T")


class _Link:
    """One connection to a socket of a deck; made when something is sent. Threads may send and read at the same time."""

    def __init__(self, port: int, ending: str, ready: select.epoll) -> None:
        self._port, self._name, self._ready = port, f"{port}{ending}", ready
        self._socket: socket.socket | None = None
        self._sending = threading.Lock()
        self._full = False

    def send(self, data: bytes, patience: float) -> None:
        """Sends a datagram, for which it connects and waits for room; raises as `LocalConnection.send`."""
        until = time.monotonic() + patience
        with self._sending:
            while True:
                before = self._socket
                connection = before or self._connect(patience)
                connection.settimeout(patience)
                try:
                    self._attempt(connection.send, data)
                    return
                except PeerGoneError:  # the deck has ended, is full, or needed the place for others
                    self._end(connection, transport.read_datagram(connection, _MOST_BYTES) == transport.TURNED_AWAY)
                if before is None and (self._full or time.monotonic() >= until):
                    raise self.gone

    def _connect(self, patience: float) -> socket.socket:
        path = transport.command_folder() / self._name
        fresh = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        # In a queue of programs that connect, only a call that blocks waits for its turn.
        fresh.setblocking(patience > 0.0)
        fresh.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _TIME.pack(int(patience), int(patience % 1.0 * 1e6)))
        self._full = False
        try:
            self._attempt(fresh.connect, str(path))
        except SocketError:
            fresh.close()
            raise
        self._ready.register(fresh, select.EPOLLIN)
        self._socket = fresh
        return fresh

    def _attempt(self, act: Callable[[T], object], given: T) -> None:
        try:
            act(given)
        except (TimeoutError, BlockingIOError):
            raise SocketError(f"the deck on port {self._port} takes no commands: it is held up") from None
        except OSError:
            raise self.gone from None

    def read(self) -> bytes:
        """What has arrived, b"" for nothing; without a peer the connection is closed."""
        connection = self._socket
        if connection is None:
            return b""
        data = transport.read_datagram(connection, _MOST_BYTES)
        if data is None or data == transport.TURNED_AWAY:
            self._end(connection, data == transport.TURNED_AWAY)
            return b""
        return data

    @property
    def number(self) -> int:
        """The file descriptor; -1 without a connection."""
        connection = self._socket
        return connection.fileno() if connection is not None else -1

    @property
    def gone(self) -> SocketError:
        if self._full:
            return SocketError(transport.FULL)
        return PeerGoneError(f"no deck is running on port {self._port}; start one with: motiondeck play")

    def close(self) -> None:
        """Ends the connection; may be called twice."""
        if self._socket is not None:
            self._end(self._socket, full=False)

    def _end(self, connection: socket.socket, full: bool) -> None:
        if self._socket is connection:
            self._socket, self._full = None, full
            self._ready.unregister(connection)
            connection.close()


class LocalConnection:
    """A client's connections to a deck of this user, for commands and its stop door, made at first use; thread-safe."""

    def __init__(self, port: int, patience: float) -> None:
        """For the deck of a number, which may keep a sender waiting `patience` s; SocketError if out of range."""
        transport.check_port(port)
        self._patience = patience
        self._ready = select.epoll()
        self._commands, self._door = _Link(port, "", self._ready), _Link(port, transport.STOP_DOOR, self._ready)
        self._awaited = 0  # replies from the door

    def send(self, data: bytes) -> None:
        """Sends a command. PeerGoneError if no deck is running there. SocketError if it is full, or takes nothing."""
        self._commands.send(data, self._patience)

    def send_stop(self, data: bytes) -> None:
        """Sends an emergency stop to the door, or as a command where that is missing or held up; raises as `send`."""
        # An older deck has no door, and neither has a loop of one's own.
        patience = min(self._patience, _STOP_PATIENCE)
        self._awaited += 1
        try:
            self._door.send(data, patience)
        except SocketError:
            self._awaited = 0
            self._commands.send(data, patience)

    def receive(self, timeout_s: float) -> bytes | None:
        """The next datagram, or None if none comes in time; PeerGoneError without a deck, SocketError if full."""
        until = time.monotonic() + timeout_s
        while self._commands.number >= 0 or (self._awaited and self._door.number >= 0):
            # Any time above 0 becomes at least a millisecond, in which a loop would give up its core.
            ready = {number for number, _ in self._ready.poll(max(until - time.monotonic(), 0.0))}
            # The door first: the events of a stop come after the reply to it.
            if self._door.number in ready:
                data = self._door.read()
                self._awaited = max(self._awaited - 1, 0) if data else 0
            elif self._commands.number in ready:
                data = self._commands.read()
            else:
                return None
            if data:
                return data
        raise self._commands.gone

    def fileno(self) -> int:
        """Readable when there is something to receive; raises a SocketError if it is not connected."""
        if self._commands.number < 0 and self._door.number < 0:
            raise self._commands.gone
        return self._ready.fileno()

    def close(self) -> None:
        """Closes the connections; may be called twice."""
        self._commands.close()
        self._door.close()
