"""What commands need of what they command: a deck, the servos of a rig, a body that can be pushed, a clock."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

from controller.wire.messages.commands import Side
from controller.wire.messages.deck_snapshot import DeckState
from controller.wire.messages.events import Event
from controller.wire.messages.lock_state import LockSource
from controller.wire.messages.replies import SecondReply


class Progress(Protocol):
    """A switch under way; `deck.switch.CommandedSwitch` has the meaning of each attribute."""

    commanded_s: float
    settled_s: float | None
    after: str
    via: tuple[str, ...]
    overtaken: bool
    fell_back: str


class Commandable(DeckState, Protocol):
    """The part of a deck that commands need; it raises a MotiondeckError for a command that it cannot carry out.

    Attributes:
        events: what has happened; whoever tells it takes it out.
        phase_at: when the present phase was due by the machine's steady clock, s; None if that is not known.
    """

    events: deque[Event]
    phase_at: float | None

    def switch(self, to: str, *, direct: bool = False) -> Progress:
        """Starts a switch."""
        ...

    def enqueue(self, to: str) -> Progress:
        """Plays a motion after the present and the queued ones."""
        ...

    def blend_in(self, first: str, second: str, weight: float, also: Sequence[tuple[str, float]] = ()) -> Progress:
        """Plays a blend of motions."""
        ...

    @property
    def phase_rate(self) -> float | None:
        """How many rounds a second a loop makes, negative backwards; None if that is not known."""
        ...

    def set_tempo(self, factor: float, over: float = 0.0) -> None:
        """Plays at another tempo."""
        ...

    def set_input(self, name: str, value: float) -> None:
        """Gives an input another value."""
        ...

    def lock(self, source: LockSource, phase: float = 0.0, steps: int = 0) -> None:
        """Locks the phase to beats, to another deck, or to the measured joints."""
        ...

    def unlock(self) -> None:
        """Locks it to nothing."""
        ...

    def beat(self, ago: float = 0.0) -> None:
        """Takes a beat."""
        ...

    def jump(self, phase: float) -> None:
        """Goes to a phase of the motion that is played."""
        ...

    def pause(self) -> None:
        """Comes to a standstill."""
        ...

    def step_on(self, seconds: float = 0.0) -> None:
        """Goes on in a pause for so long."""
        ...

    def resume(self) -> None:
        """Plays on."""
        ...


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
        clock: the time at which it notes what happens to it, s.
        holds: whether it is to stay as it lies, and not get up.
    """

    fallen: bool
    clock: Callable[[], float]
    holds: Callable[[], bool]

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
