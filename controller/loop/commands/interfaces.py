"""The sender of a command, and protocols of what commands act on: a deck, servos, a body to be pushed."""

# ruff: noqa: D102 (`controller.deck.deck.Deck` and `RigOutput` of a run document what these do)

from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, runtime_checkable

from controller.deck.switch import CommandedSwitch
from controller.wire.command_socket import Address, CommandServer
from controller.wire.messages.commands import Side
from controller.wire.messages.deck_snapshot import DeckState
from controller.wire.messages.lock_state import LockSource
from controller.wire.messages.replies import Event, Reply, SecondReply


class Playback(DeckState, Protocol):
    """What commands need of any deck, as `controller.deck.deck.Deck` has it; it refuses by a MotiondeckError."""

    events: deque[Event]  # what has happened and is still to be sent
    phase_at: float | None  # when the present phase was due by the machine's steady clock, s; None if that is not known

    @property
    def phase_rate(self) -> float | None: ...
    def set_tempo(self, factor: float, over: float = 0.0) -> None: ...
    def pause(self) -> None: ...
    def step_on(self, seconds: float = 0.0) -> None: ...
    def resume(self) -> None: ...


@runtime_checkable
class Commandable(Playback, Protocol):
    """A deck whose motions can be commanded, unlike the replay of a recording."""

    def switch(self, to: str, *, direct: bool = False) -> CommandedSwitch: ...
    def enqueue(self, to: str) -> CommandedSwitch: ...
    def blend_in(
        self, first: str, second: str, weight: float, also: Sequence[tuple[str, float]] = ()
    ) -> CommandedSwitch: ...
    def set_input(self, name: str, value: float, seconds: float = ...) -> None: ...
    def gaze(self, left: float, up: float, ahead: float = ..., seconds: float = ...) -> None: ...
    def layer(self, group: str, motion: str, weight: float = 1.0, tempo: float = 1.0) -> None: ...
    def lock(self, source: LockSource, phase: float = 0.0, steps: int = 0) -> None: ...
    def unlock(self) -> None: ...
    def beat(self, ago: float = 0.0) -> None: ...
    def jump(self, phase: float) -> None: ...


class Look(Protocol):
    """A request to servos that is under way."""

    def answer(self) -> SecondReply | None: ...  # the reply, or None before it has come


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
