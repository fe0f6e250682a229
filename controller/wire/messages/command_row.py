"""The row of a command: when and where it is allowed, how it is spelled and recorded."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from inspect import getdoc
from typing import Annotated, ClassVar, Literal, NamedTuple, get_args, get_type_hints

import msgspec

from controller.wire.messages.arguments import Argument, CommandError, MotionName
from controller.wire.messages.deck_snapshot import Mode

Natural = Annotated[int, msgspec.Meta(ge=0, lt=2**53)]  # a whole number from 0 on that JSON carries exactly

Use = Literal["timed", "cue", "script", "film", "replay"]
USES: dict[Use, str] = {
    "timed": "a later time",
    "cue": "a show",
    "script": "a timeline file",
    "film": "a film",
    "replay": "a replay",
}
"""Where a command may be used besides live, and how errors name it."""

ALWAYS: frozenset[Mode] = frozenset(get_args(Mode))
RELEASED: frozenset[Mode] = ALWAYS - {"emergency stop"}


class ArgumentField(NamedTuple):
    """An argument, the field of the message that holds it, and whether it may be left out."""

    field: str
    argument: Argument
    optional: bool


@dataclass(eq=False)
class CommandRow:
    """What there is to know of a command besides its message, whose class attribute `row` this is.

    The tag of the message is the word that is typed, its annotated fields are the arguments in the order in which they
    are typed, and the first line of its docstring is the help.
    """

    uses: tuple[Use, ...]
    modes: frozenset[Mode] = RELEASED
    aliases: tuple[str, ...] = ()
    record: int = 0  # its number in recordings, from 1, never reused; 0 if it is not recorded
    # The reply that follows the one to the command: a motion has settled, or servos have replied.
    second_reply: Literal["", "settled", "servos"] = ""
    message: type[CommandMessage] = field(init=False)

    def __set_name__(self, message: type[CommandMessage], name: str) -> None:
        self.message = message

    @property
    def word(self) -> str:
        """The word that is typed."""
        return str(self.message.__struct_config__.tag)

    @property
    def help(self) -> str:
        """One line."""
        return (getdoc(self.message) or "").partition("\n")[0]

    @cached_property
    def arguments(self) -> tuple[ArgumentField, ...]:
        """In the order in which they are typed."""
        hints = get_type_hints(self.message, include_extras=True)
        return tuple(
            ArgumentField(one.name, argument, not one.required)
            for one in msgspec.structs.fields(self.message)
            for argument in getattr(hints[one.name], "__metadata__", ())
            if isinstance(argument, Argument)
        )

    @property
    def usage(self) -> str:
        """The command with its arguments, as in "tempo TEMPO [SECONDS]"."""
        names = (f"[{one.argument.name}]" if one.optional else one.argument.name for one in self.arguments)
        return " ".join([self.word, *names])

    def check_use(self, use: Use) -> None:
        """Raises a CommandError, which lists what is allowed, where the command may not be used."""
        if use not in self.uses:
            words = ", ".join(kind.row.word for kind in CommandMessage.__subclasses__() if use in kind.row.uses)
            raise CommandError(f"'{self.word}' is not for {USES[use]}, which takes: {words}")


class CommandMessage(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The base of all commands; replies repeat the number of the command, `id`."""

    row: ClassVar[CommandRow]
    id: Natural = 0

    @property
    def motions(self) -> tuple[str, ...]:
        """The motions that it names."""
        return tuple(getattr(self, one.field) for one in self.row.arguments if isinstance(one.argument, MotionName))

    def check(self) -> None:
        """Raises a CommandError where an argument is out of its range."""
        for one in self.row.arguments:
            one.argument.check(getattr(self, one.field))
