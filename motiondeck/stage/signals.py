"""Signals, and the protocol of their inputs."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

from controller.wire.messages.commands import DeckCommand

Notify = Callable[[str], None]  # prints a line for the user


@dataclass(frozen=True, slots=True)
class Signal:
    """A command that a signal stands for."""

    due: float  # when it is to be given, s, by the bridge's clock; in the past where it was noticed late
    source: str
    command: DeckCommand


class Input(Protocol):
    """An input of signals."""

    def fileno(self) -> int:
        """A file descriptor that can be read when signals have come."""
        ...

    def read(self, now: float) -> Iterator[Signal]:
        """The signals up to a time of the bridge's clock, s; never waits. MidiGoneError if a device is gone."""
        ...

    def close(self) -> None:
        """Closes the socket or device; may be called twice."""
