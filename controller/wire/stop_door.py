"""The stop door: a local socket of a deck at which an emergency stop is taken, and nothing else.

It has its own places, apart from those for commands. When all are taken, the longest idle holder makes room, after
all that it has sent is read; so no number of clients keeps an emergency stop out. A client proves that it is of this
user, and nothing else. Without numpy, as the small process that guards a rig has the door too.
"""

import contextlib
import select
import socket
from collections import deque
from dataclasses import dataclass, field

import msgspec

from controller.wire.local_transport import STOP_DOOR, LocalSocket, read_datagram, send_datagram
from controller.wire.messages.command_table import number_in
from controller.wire.messages.commands import MOST_BYTES, EmergencyStop, encode
from controller.wire.messages.replies import Accepted, Refused

PLACES = 16
_BACKLOG = 64
_WORK = 128  # datagrams in one poll, besides those of programs that have to leave
_REMEMBERED = 16  # presses of one connection
_REFUSAL = "only an emergency stop is taken here; give commands at the deck's command socket"

_press = msgspec.json.Decoder(EmergencyStop)


@dataclass(eq=False)
class _Holder:
    """A program that is connected, and the numbers of its latest presses."""

    connection: socket.socket
    presses: deque[int] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))


class StopDoor:
    """Takes emergency stops; never blocks, and never raises once it is open."""

    def __init__(self, port: int) -> None:
        """Opens the door of the deck with that port; SocketError if it is taken, or its folder not private."""
        self._socket = LocalSocket(port, STOP_DOOR, _BACKLOG)
        self._holders: dict[int, _Holder] = {}  # the longest idle first
        self._ready = self._socket.ready

    def poll(self) -> int:
        """Answers what has arrived; the number of new presses."""
        # A stop that is sent again, with its number on its connection, counts once; one without a number always counts.
        presses, work, admitted = 0, _WORK, 0
        while work > 0 and (found := self._ready.poll(0)):
            work -= len(found)
            for number, _ in found:
                if number == self._socket.number:
                    # With more a program would have to leave before it has had a chance to send.
                    while admitted < PLACES and (connection := self._socket.accept()) is not None:
                        admitted += 1
                        self._holders[connection.fileno()] = _Holder(connection)
                        self._ready.register(connection, select.EPOLLIN)
                        presses += self._dismiss(next(iter(self._holders))) if len(self._holders) > PLACES else 0
                elif number in self._holders:  # else it had to make room
                    presses += self._read(number)
        return presses

    def fileno(self) -> int:
        """Readable when there is something to poll."""
        return self._ready.fileno()

    def close(self) -> None:
        """Ends all connections and removes the socket; may be called twice."""
        self._socket.close(holder.connection for holder in self._holders.values())
        self._holders.clear()

    def _dismiss(self, number: int) -> int:
        """Ends a connection, after all that it has sent is read: an emergency stop is not lost with it."""
        holder = self._holders.pop(number)
        with contextlib.suppress(OSError):
            holder.connection.shutdown(socket.SHUT_RD)  # what it sends from now on fails, for it to see
        presses = 0
        while data := read_datagram(holder.connection, MOST_BYTES + 1):
            presses += self._answer(holder, data)
        self._end(holder)
        return presses

    def _read(self, number: int) -> int:
        """Answers one datagram of a holder; 1 for a new press. A holder that has gone is dropped."""
        holder = self._holders.pop(number)
        data = read_datagram(holder.connection, MOST_BYTES + 1)
        if data is None:
            self._end(holder)
            return 0
        self._holders[number] = holder  # as the latest that was heard
        return self._answer(holder, data) if data else 0

    def _end(self, holder: _Holder) -> None:
        self._ready.unregister(holder.connection)
        holder.connection.close()

    def _answer(self, holder: _Holder, data: bytes) -> int:
        try:
            press = _press.decode(data)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
            send_datagram(holder.connection, encode(Refused(_REFUSAL, number_in(data))))
            return 0
        send_datagram(holder.connection, encode(Accepted(press.id)))
        if press.id and press.id in holder.presses:
            return 0
        holder.presses.append(press.id)
        return 1
