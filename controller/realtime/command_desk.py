"""The command desk: carries out on a deck what comes in over a socket, and reports back when a switch has settled."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Protocol

from controller.errors import MotiondeckError
from controller.realtime.commands import (
    Accepted,
    Address,
    CommandServer,
    Message,
    Pause,
    Refused,
    Reply,
    Resume,
    SetSpeed,
    Settled,
    State,
    Status,
    Stop,
    Switch,
)
from controller.realtime.stop import StopRequest

_MOST_AWAITED = 256  # switches whose end somebody waits for


class Progress(Protocol):
    """A switch under way, as the deck keeps it: its times, s since the deck's start; None while still to come."""

    commanded_s: float
    settled_s: float | None


class Commandable(Protocol):
    """What the desk asks of a deck; what it cannot do it answers with a MotiondeckError that says why."""

    @property
    def motions(self) -> Sequence[str]:
        """All it can play."""
        ...

    @property
    def speed(self) -> float:
        """The tempo."""
        ...

    @property
    def paused(self) -> bool:
        """Whether it stands still on command."""
        ...

    @property
    def motion(self) -> str:
        """What is played, or being switched to."""
        ...

    @property
    def settled(self) -> bool:
        """Whether no switch is under way."""
        ...

    def switch(self, to: str) -> Progress:
        """Starts a switch."""
        ...

    def set_speed(self, factor: float) -> None:
        """Plays at another tempo."""
        ...

    def pause(self) -> None:
        """Comes to a standstill."""
        ...

    def resume(self) -> None:
        """Goes on."""
        ...


class CommandDesk:
    """Carries out the commands that have come, once a tick; it never waits, and no client can make it raise."""

    def __init__(self, deck: Commandable, server: CommandServer) -> None:
        self._deck = deck
        self._server = server
        self._awaited: deque[tuple[Address, Switch, Progress]] = deque(maxlen=_MOST_AWAITED)

    def __call__(self, stop: StopRequest) -> None:
        """Answers what has come, and those who wait for a switch that has settled or been overtaken."""
        for message, sender in self._server.poll():
            self._server.reply(sender, self._answer(message, sender, stop))
        for _ in range(len(self._awaited)):
            sender, message, progress = self._awaited.popleft()
            if progress.settled_s is not None:
                took = progress.settled_s - progress.commanded_s
                self._server.reply(sender, Settled(message.to, took, message.id))
            elif self._deck.settled:
                self._server.reply(sender, Refused(f"the switch to {message.to} was overtaken by another", message.id))
            else:
                self._awaited.append((sender, message, progress))

    def _answer(self, message: Message, sender: Address, stop: StopRequest) -> Reply:
        deck = self._deck
        try:
            match message:
                case Switch(to=to):
                    self._awaited.append((sender, message, deck.switch(to)))
                case SetSpeed(factor=factor):
                    deck.set_speed(factor)
                case Pause():
                    deck.pause()
                case Resume():
                    deck.resume()
                case Stop():
                    stop.ask("stopped on command")
                case Status():
                    return State(deck.motion, list(deck.motions), deck.speed, deck.paused, not deck.settled, message.id)
        except MotiondeckError as error:
            return Refused(str(error), message.id)
        return Accepted(message.id)
