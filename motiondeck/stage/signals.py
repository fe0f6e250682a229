"""What the inputs of a stage and the bridge to a deck have in common."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

from controller.wire.messages.commands import DeckCommand

Tell = Callable[[str], None]
"""Says something to the person who runs the program."""


@dataclass(frozen=True, slots=True)
class Signal:
    """A command that a signal stands for.

    Attributes:
        due: when it is to be given, s, by the bridge's clock; in the past where it was noticed late.
        source: what it came from, for a person.
        command: what it asks of the deck.
    """

    due: float
    source: str
    command: DeckCommand


class Input(Protocol):
    """Where signals come from."""

    def fileno(self) -> int:
        """A file descriptor that can be read when signals have come."""
        ...

    def read(self, now: float) -> Iterator[Signal]:
        """The signals that have come, at a time of the bridge's clock, s; never waits.

        Raises:
            MidiGoneError: if a device is gone.
        """
        ...

    def close(self) -> None:
        """Lets go of the socket or device; may be called twice."""
        ...
