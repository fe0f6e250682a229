"""The table of commands: reads typed commands and datagrams by the rows of `commands`."""

from collections.abc import Sequence
from functools import cache
from typing import Any, get_args

import msgspec

from controller.wire.messages.arguments import CommandError, WeightedMotions, WholeCommand
from controller.wire.messages.command_row import CommandRow, Natural
from controller.wire.messages.commands import MOST_BYTES, DeckCommand, Switch
from motiondeck_base.files import shortened
from motiondeck_base.words import did_you_mean

_MESSAGES: tuple[type[DeckCommand], ...] = get_args(DeckCommand)  # the types of all messages

COMMANDS: tuple[CommandRow, ...] = tuple(message.row for message in _MESSAGES)
BY_WORD = {word: row for row in COMMANDS for word in (row.word, *row.aliases)}
RECORDED = {row.record: row.word for row in COMMANDS if row.record}
"""The word of each number in the field `command` of recordings."""

_decoder: msgspec.json.Decoder[DeckCommand] = msgspec.json.Decoder(DeckCommand)


def checked(message: DeckCommand) -> DeckCommand:
    """The message itself; CommandError if an argument is not in its range; it names the argument and the range."""
    message.check()
    return message


@cache
def usages() -> str:
    """All commands with their arguments; the first call takes some ms, and so would the first use of each row."""
    return ", ".join(row.usage for row in COMMANDS)


def read_command(data: bytes) -> DeckCommand:
    """The command in a datagram; CommandError, with what is allowed, if it is none or an argument is out of range."""
    if len(data) > MOST_BYTES:
        raise CommandError(f"this message is too long; {MOST_BYTES} bytes are the most")
    try:
        return checked(_decoder.decode(data))
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise CommandError(f"this is not a command ({error}). Commands: {usages()}.") from error


class _Numbered(msgspec.Struct):
    id: Natural = 0


_numbered = msgspec.json.Decoder(_Numbered)


def number_in(data: bytes) -> int:
    """The number of a command that cannot be read otherwise, or 0."""
    try:
        return _numbered.decode(data).id
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return 0


def parse_command(words: Sequence[str]) -> DeckCommand:
    """The message of typed words: a command and its arguments, or a motion's name alone, which switches to it.

    A single word may be a whole command, such as "switch jog". CommandError, with all commands, if they are none.
    """
    if len(words) == 1 and words[0].split()[:1] and words[0].split()[0] in BY_WORD:
        words = words[0].split()
    row = BY_WORD.get(words[0]) if words else None
    if row is not None:
        with CommandError.placed(words[0]):
            return checked(_MESSAGES[COMMANDS.index(row)](**_values(row, words[1:])))
    if len(words) == 1:
        return checked(Switch(words[0]))
    hint = did_you_mean(words[0], BY_WORD) if words else ""
    raise CommandError(f"'{shortened(' '.join(words))}' is not a command.{hint} `motiondeck send help` lists them.")


def _values(row: CommandRow, words: Sequence[str]) -> dict[str, Any]:
    """The fields of a message from its typed arguments; raises a CommandError if there are too few or too many."""
    arguments = row.arguments
    several = bool(arguments) and isinstance(arguments[-1].argument, WeightedMotions)
    required = sum(not one.optional for one in arguments)
    if len(words) < required or (not several and len(words) > len(arguments)):
        raise CommandError(f"give it as: {row.usage}")
    values: dict[str, Any] = {}
    for place, one in enumerate(arguments):
        if isinstance(one.argument, WeightedMotions):
            values[one.field] = one.argument.parse(words[place:])
        elif place < len(words):
            word = words[place]
            values[one.field] = (
                parse_command(word.split()) if isinstance(one.argument, WholeCommand) else one.argument.parse(word)
            )
    return values
