"""Signals, and the commands that a stage file writes for them: lines of the prompt; $1 to $9 are what one carries."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from controller.wire.messages.arguments import CommandError
from controller.wire.messages.command_table import BY_WORD, parse_command
from controller.wire.messages.commands import DeckCommand
from motiondeck_base.files import shortened

Notify = Callable[[str], None]  # prints a line for the user

_PLACE = re.compile(r"\$([1-9])")


@dataclass(frozen=True, slots=True)
class Signal:
    """A command that a signal stands for."""

    due: float  # when it is to be given, s, by the bridge's clock; in the past where it was noticed late
    source: str
    command: DeckCommand


@dataclass(frozen=True)
class CommandPattern:
    """One command, complete or with places for arguments."""

    text: str

    def __post_init__(self) -> None:
        """Checks what can be known before a signal comes; CommandError if it is no command, or lacks arguments."""
        words = self.text.split()
        if self.complete:
            parse_command(words)
        elif words[0] not in BY_WORD:
            raise CommandError(f"'{shortened(self.text)}' does not begin with a command, such as: tempo $1")
        else:
            command = BY_WORD[words[0]]
            required = sum(not argument.optional for argument in command.arguments)
            if not required <= len(words) - 1 <= len(command.arguments):
                raise CommandError(f"'{shortened(self.text)}': give it as: {command.usage}")

    @property
    def complete(self) -> bool:
        """Whether it needs no arguments."""
        return _PLACE.search(self.text) is None

    @property
    def motions(self) -> tuple[str, ...]:
        """The motions that the command names."""
        return parse_command(self.text.split()).motions if self.complete else ()

    def command(self, arguments: Sequence[object] = ()) -> DeckCommand | None:
        """The command that a signal with these arguments gives; None for a button that is released.

        A complete command is given by a button that is pressed; the only argument 0 or false says that it was released.
        CommandError if an argument is missing or not allowed.
        """
        if self.complete:
            released = len(arguments) == 1 and isinstance(arguments[0], int | float) and not arguments[0]
            return None if released else parse_command(self.text.split())
        missing = [number for number in _PLACE.findall(self.text) if int(number) > len(arguments)]
        if missing:
            raise CommandError(f"argument {missing[0]} is missing; it is mapped to: {self.text}")
        words = [_PLACE.sub(lambda place: _word(arguments[int(place[1]) - 1]), word) for word in self.text.split()]
        return parse_command(words)


def _word(argument: object) -> str:
    """An argument as it would be typed; controllers send whole numbers as floats too."""
    return f"{argument:.9g}" if isinstance(argument, float) else str(argument)
