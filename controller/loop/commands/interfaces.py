"""What commands need of what they command: a deck, the servos of a rig, a body that can be pushed, a clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from controller.wire.messages.commands import Side
from controller.wire.messages.replies import SecondReply


class Progress(Protocol):
    """A switch under way; `deck.switch.CommandedSwitch` has the meaning of each attribute."""

    commanded_s: float
    settled_s: float | None
    after: str
    via: tuple[str, ...]
    overtaken: bool
    fell_back: str


class Look(Protocol):
    """A look at servos that is under way."""

    def answer(self) -> SecondReply | None:
        """What came of it, or None as long as nothing has."""
        ...


class RigServos(Protocol):
    """The servos of a rig, as commands need them; no call waits."""

    def switch(self, joint: str, *, on: bool) -> None:
        """Takes the torque off a joint, or has it set up again."""
        ...

    def restart(self, joint: str) -> None:
        """Has the servo of a joint restarted."""
        ...

    def registers(self, joint: str, write: tuple[str, int] | None = None) -> Look:
        """Has all registers of a servo read, and before that one of them written."""
        ...

    def scan(self) -> Look:
        """Has everybody asked who is on the ports."""
        ...


@runtime_checkable
class Pushable(Protocol):
    """A simulated body that can be pushed; the call does not wait.

    Attributes:
        fallen: whether it lies.
    """

    fallen: bool

    def attach(self, clock: Callable[[], float], holds: Callable[[], bool]) -> None:
        """Connects the clock of its events, s, and whether it is to stay as it lies and not get up."""
        ...

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
        ...
