"""The sender of a command, and what commands act on: a deck, servos, a body to be pushed."""

# ruff: noqa: D102 (`RigOutput` of a run documents what these do)

from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

from controller.deck.deck import Deck
from controller.deck.recorded_deck import RecordedDeck
from controller.wire.command_socket import Address, CommandServer
from controller.wire.messages.commands import Side
from controller.wire.messages.replies import Reply, SecondReply

PlayableDeck = Deck | RecordedDeck  # of the replay of a recording the motions cannot be commanded
Look = Callable[[], SecondReply | None]  # the reply to a request to servos, or None before it has come


class RigServos(Protocol):
    """The servos of a rig, as commands need them; no call waits."""

    def switch(self, joint: str, *, on: bool) -> None: ...
    def restart(self, joint: str) -> None: ...
    def registers(self, joint: str, write: tuple[str, int] | None = None) -> Look: ...
    def scan(self) -> Look: ...


@runtime_checkable
class Pushable(Protocol):
    """A simulated body that can be pushed; the call does not wait."""

    fallen: bool

    def attach(self, clock: Callable[[], float], holds: Callable[[], bool]) -> None:
        """Connects the clock of its events, s, and whether it is to stay as it lies and not get up."""

    def push_from(self, side: Side, impulse: float, towards: float | None) -> float:
        """Pushes it from a side, or towards a direction, with an impulse, N s, 0 for its own choice; that impulse."""
        ...


class Client(NamedTuple):
    """The sender of a command, and the socket that received it."""

    server: CommandServer
    sender: Address

    @property
    def connected(self) -> bool:
        """Whether it is connected, as far as its socket knows."""
        return self.server.connected(self.sender)

    def reply(self, reply: Reply) -> None:
        """Sends it a reply or an event; it never waits."""
        self.server.reply(self.sender, reply)
