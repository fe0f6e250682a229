"""Asks another deck again and again how far its motion is, without waiting for the answers."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

from controller.wire.command_socket import CommandClient, SocketError
from controller.wire.messages.commands import CommandError, GetPhase
from controller.wire.messages.replies import PhaseNow

ASKED_EVERY = 0.05  # s
UNANSWERED_AFTER = 0.5  # s until a question counts as lost


@dataclass(frozen=True, slots=True)
class Sighting:
    """How far another deck was.

    Attributes:
        time: when, by the asking deck's clock, s.
        phase: of its loop, [0, 1).
        rate: how fast the loop turned, rounds a second; negative backwards.
    """

    time: float
    phase: float
    rate: float


class LeaderLink:
    """Sees how far another deck of this machine is, and when: by the clock that both have, if the answer tells it,
    else in the middle between question and answer.

    Args:
        client: connected to that deck; with patience it could hold up a loop.
    """

    def __init__(self, client: CommandClient) -> None:
        self._client = client
        self._question, self._asked = 0, -ASKED_EVERY
        self._answered = True

    @classmethod
    def to(cls, port: str) -> LeaderLink:
        """A link to a deck of this user by the number of its command port; asking one elsewhere could hold up a loop.

        Raises:
            CommandError: if it is no number of a port.
        """
        if not port.isdecimal() or not 0 < int(port) < 65536:
            raise CommandError(f"'{port}' is nothing to lock to: give beat, body, or the command port of another deck")
        return cls(CommandClient(int(port), patience=0.0))

    def __call__(self, time: float) -> Sighting | None:
        """What has been seen since the last call, at a time of the asking deck, s; None where nothing turns."""
        sighting = self._look(time)
        waited = time - self._asked
        if waited >= (ASKED_EVERY if self._answered else UNANSWERED_AFTER):
            self._asked, self._answered = time, False
            with contextlib.suppress(SocketError):  # nobody is there yet, or any more, or it is held up
                self._question = self._client.post(GetPhase())
        return sighting

    def _look(self, time: float) -> Sighting | None:
        sighting = None
        if self._answered:
            return None
        with contextlib.suppress(SocketError, CommandError):
            while (reply := self._client.receive(0.0)) is not None:
                if not isinstance(reply, PhaseNow) or reply.id != self._question:
                    continue
                self._answered = True
                if reply.phase is not None and reply.rate is not None:
                    seen = reply.at if reply.at is not None else 0.5 * (self._asked + time)
                    sighting = Sighting(seen, reply.phase, reply.rate)
        return sighting

    def close(self) -> None:
        """Ends the questions; may be called twice."""
        self._client.close()
