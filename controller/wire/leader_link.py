"""Polls the phase of another deck without waiting for its replies."""

import contextlib
from dataclasses import dataclass
from typing import Self

from controller.wire.command_socket import CommandClient, SocketError
from controller.wire.messages.arguments import CommandError
from controller.wire.messages.commands import GetPhase
from controller.wire.messages.replies import PhaseNow

ASKED_EVERY = 0.05  # s
UNANSWERED_AFTER = 0.5  # s until a request counts as lost


@dataclass(frozen=True, slots=True)
class Sighting:
    """The phase of another deck."""

    time: float  # when, by the asking deck's clock, s
    phase: float
    rate: float  # rounds per second; negative backwards


class LeaderLink:
    """Observes the phase of another deck of this machine, through a client with patience 0, which never blocks.

    Its time is the one in the reply, by their common clock, else the middle between request and reply.
    """

    def __init__(self, client: CommandClient) -> None:
        self._client = client
        self._request, self._asked = 0, -ASKED_EVERY
        self._answered = True

    @classmethod
    def to(cls, port: str) -> Self:
        """A link to a deck of this user by its port, or a CommandError; a remote one could block the loop."""
        if not port.isdecimal() or not 0 < int(port) < 65536:
            raise CommandError(f"'{port}' is nothing to lock to: give beat, body, or the command port of another deck")
        return cls(CommandClient(int(port), patience=0.0))

    def __call__(self, time: float) -> Sighting | None:
        """The observation since the last call, at `time` of the asking deck, s; None without a new one, or a phase."""
        sighting = None if self._answered else self._receive(time)
        if time - self._asked >= (ASKED_EVERY if self._answered else UNANSWERED_AFTER):
            self._asked, self._answered = time, False
            with contextlib.suppress(SocketError):  # not running, or held up
                self._request = self._client.post(GetPhase())
        return sighting

    def _receive(self, time: float) -> Sighting | None:
        sighting = None
        with contextlib.suppress(SocketError, CommandError):
            while (reply := self._client.receive(0.0)) is not None:
                if not isinstance(reply, PhaseNow) or reply.id != self._request:
                    continue
                self._answered = True
                if reply.phase is not None and reply.rate is not None:
                    seen = reply.at if reply.at is not None else 0.5 * (self._asked + time)
                    sighting = Sighting(seen, reply.phase, reply.rate)
        return sighting

    def close(self) -> None:
        """Ends the requests; may be called twice."""
        self._client.close()
