"""Signals: commands that come from OSC and MIDI."""

from collections.abc import Callable
from dataclasses import dataclass

from controller.wire.messages.commands import DeckCommand

Notify = Callable[[str], None]  # prints a line for the user


@dataclass(frozen=True, slots=True)
class Signal:
    """A command that a signal stands for."""

    due: float  # when it is to be given, s, by the bridge's clock; in the past where it was noticed late
    source: str
    command: DeckCommand
