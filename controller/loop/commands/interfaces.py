"""The sender of a command, and protocols of what commands act on: servos, a body that can be pushed, a clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

from controller.wire.command_socket import Address, CommandServer
from controller.wire.messages.commands import Side
from controller.wire.messages.replies import Reply, SecondReply


class Progress(Protocol):
    """A switch under way; `deck.switch.CommandedSwitch` has the meaning of each attribute."""

    commanded_s: float
    settled_s: float | None
    after: str
    via: tuple[str, ...]
    overtaken: bool
    fell_back: str


class Look(Protocol):
    """A request to servos that is under way."""

    def answer(self) -> SecondReply | None:
        """The reply, or None before it has come."""
        ...


class RigServos(Protocol):
    """The servos of a rig, as commands need them; no call waits."""

    def switch(self, joint: str, *, on: bool) -> None:
        """Switches the torque of a joint off, or sets the joint up again."""

    def restart(self, joint: str) -> None:
        """Restarts the servo of a joint."""

    def registers(self, joint: str, write: tuple[str, int] | None = None) -> Look:
        """Starts reading all registers of a servo, after writing one of them if given."""
        ...

    def scan(self) -> Look:
        """Starts a scan of the ports."""
        ...


@runtime_checkable
class Pushable(Protocol):
    """A simulated body that can be pushed; the call does not wait."""

    fallen: bool

    def attach(self, clock: Callable[[], float], holds: Callable[[], bool]) -> None:
        """Connects the clock of its events, s, and whether it is to stay as it lies and not get up."""

    def push_from(self, side: Side, impulse: float, towards: float | None) -> float:
        """Pushes it from a side, or towards a direction, with an impulse, N s, 0 for its own choice; that impulse."""
        ...


class RealTime(Protocol):
    """The clock of a loop in real time; no call waits."""

    @property
    def period(self) -> float:
        """Seconds from tick to tick."""
        ...

    def due(self) -> float:
        """When the present tick was due, by the machine's steady clock, s."""
        ...

    def align(self, here: int, there: int) -> None:
        """Moves them onto those of a clock that shows `there` when this one shows `here`, ns."""


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
