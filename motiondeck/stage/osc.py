"""OSC: messages of programs on this machine are commands, and what the deck does is sent as messages.

OSC has no authentication. Messages are therefore taken on loopback only, and only from programs of this user, by the
system's table of sockets.
"""

from __future__ import annotations

import contextlib
import os
import socket
import struct
import time
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from controller.wire.messages.arguments import CommandError
from controller.wire.messages.replies import Event, State
from motiondeck.stage.command_pattern import CommandPattern, Notify, Signal
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.socket_owners import owners_of_datagrams

if TYPE_CHECKING:
    from pythonosc.osc_packet import TimedMessage

LOOPBACK = "127.0.0.1"
LONGEST_AHEAD = 60.0  # the most that a bundle's time tag may be ahead, s; later ones are of another clock
_MOST = 256  # datagrams read at once


class LoopbackPort:
    """A port for datagrams of this user's programs; MotiondeckError without python-osc, or if it cannot be had.

    That error names the place in the stage file where another is chosen.
    """

    def __init__(self, port: int, what: str, place: str, notify: Notify) -> None:
        _require_python_osc()
        self._notify = notify
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((LOOPBACK, port))
        except OSError as error:
            self._socket.close()
            raise MotiondeckError(
                f"{what} cannot listen on port {port} ({error.strerror}). Choose another: listen in {place}"
            ) from None

    def fileno(self) -> int:
        """The socket."""
        return self._socket.fileno()

    def datagrams(self, what: str) -> Iterator[bytes]:
        """Those that have come, at most _MOST; of other users' programs they are reported and left out."""
        for _ in range(_MOST):
            try:
                data, sender = self._socket.recvfrom(65536)
            except BlockingIOError:
                return
            owners = owners_of_datagrams(sender)
            if owners and owners <= {0, os.geteuid()}:
                yield data
                continue
            whose = "another user's program" if owners else "a program that has already closed its socket"
            self._notify(f"{what} from {whose} was left out")

    def messages(self, data: bytes) -> list[TimedMessage]:
        """The messages of an OSC packet; one that is malformed is reported and has none."""
        from pythonosc.osc_packet import OscPacket, ParseError

        try:
            return OscPacket(data).messages
        except (ParseError, ValueError, IndexError, struct.error, RecursionError) as error:
            self._notify(f"OSC that cannot be read was left out ({error})")
            return []

    def close(self) -> None:
        """Closes the socket; may be called twice."""
        self._socket.close()


class OscInput(LoopbackPort):
    """Commands from OSC messages to a port on loopback, by their address; what is refused here is passed to `notify`.

    A message in a bundle counts at the bundle's time, one with an address that nothing is mapped to not at all.
    """

    def __init__(self, port: int, commands: Mapping[str, CommandPattern], notify: Notify) -> None:
        super().__init__(port, "OSC", "[osc]", notify)
        self._commands = commands

    def read(self, now: float) -> Iterator[Signal]:
        """The commands that have arrived; malformed messages and those of other users are reported and left out."""
        for data in self.datagrams("OSC"):
            for timed in self.messages(data):
                yield from self._signals(timed, now)

    def _signals(self, timed: TimedMessage, now: float) -> Iterator[Signal]:
        address = timed.message.address
        pattern = self._commands.get(address)
        if pattern is None:
            return
        ahead = max(0.0, timed.time - time.time())
        if ahead > LONGEST_AHEAD:
            self._notify(f"{address}: its time is {ahead:.0f} s ahead, so it was left out")
            return
        try:
            command = pattern.command(timed.message.params)
        except CommandError as error:
            self._notify(f"{address}: {error}")
            return
        if command is not None:
            yield Signal(now + ahead, address, command)


class OscOutput:
    """Sends events and states of a deck by OSC; MotiondeckError without python-osc, or if there is no such host."""

    def __init__(self, host: str, port: int) -> None:
        _require_python_osc()
        from pythonosc.udp_client import SimpleUDPClient

        try:
            self._client = SimpleUDPClient(host, port)
        except OSError as error:
            raise MotiondeckError(f"OSC cannot be sent to {host} ({error.strerror}). See send_to in [osc]") from None

    def event(self, event: Event) -> None:
        """Sends what has happened, as /motiondeck/event: kind, text, motion, s of the deck, number."""
        self._send("event", event.kind, event.text, event.motion, event.at, event.number)

    def state(self, state: State) -> None:
        """Sends what is played, as /motiondeck/motion, tempo, phase, mode and lock."""
        self._send("motion", state.motion)
        self._send("tempo", state.tempo)
        if state.phase is not None:
            self._send("phase", state.phase)
        self._send("mode", "paused" if state.paused and state.mode == "playing" else state.mode)
        self._send("lock", state.lock.state if state.lock is not None else "none")

    def _send(self, name: str, *values: str | float) -> None:
        with contextlib.suppress(OSError):  # no receiver, or no network: OSC is not repeated
            self._client.send_message(f"/motiondeck/{name}", values)

    def close(self) -> None:
        """Closes the socket; may be called twice."""
        self._client.close()


def _require_python_osc() -> None:
    try:
        import pythonosc  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ImportError:
        raise MotiondeckError('OSC needs python-osc. Install it with: pip install "motiondeck[stage]"') from None
