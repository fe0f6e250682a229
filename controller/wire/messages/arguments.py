"""The arguments of commands: how each kind is read from a typed word, and what is allowed.

`field` is an argument's field in the message, `name` its name in the help.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from controller.wire.messages.commands import CommandError

LONGEST_NAME = 100


@dataclass(frozen=True)
class Text:
    """An argument that is a name or a path; `what` is said of it in errors."""

    field: str
    name: str
    what: str
    longest: int = LONGEST_NAME
    optional = False

    def parse(self, word: str) -> str:
        """The word itself."""
        return word

    def check(self, value: str) -> None:
        """Raises a CommandError for an empty or too long text, and for bytes of a command line that are none."""
        if not 0 < len(value) <= self.longest:
            raise CommandError(f"{self.what} has 1 to {self.longest} characters")
        try:
            value.encode()
        except UnicodeEncodeError:
            raise CommandError(f"{self.what} is text in UTF-8, not {value!a}") from None


def motion_name(field: str, name: str = "MOTION") -> Text:
    """An argument that names a motion."""
    return Text(field, name, "the name of a motion")


@dataclass(frozen=True)
class Number:
    """An argument that is a number from `lowest` to `highest`; with `whole` it has no fraction."""

    field: str
    name: str
    lowest: float
    highest: float
    optional: bool = False
    whole: bool = False

    def parse(self, word: str) -> float:
        """The number; raises a CommandError where the word is none."""
        try:
            return int(word) if self.whole else float(word)
        except ValueError:
            raise CommandError(self._range(f"'{word}'")) from None

    def check(self, value: float) -> None:
        """Raises a CommandError where a number is outside the range or not finite."""
        if not (math.isfinite(value) and self.lowest <= value <= self.highest):
            raise CommandError(self._range(f"{value:g}"))

    def _range(self, given: str) -> str:
        kind = "a whole number" if self.whole else "a number"
        return f"{self.name} must be {kind} from {self.lowest:g} to {self.highest:g}, not {given}"


@dataclass(frozen=True)
class Flag:
    """An argument that is either its own name or left out."""

    field: str
    name: str
    optional = True

    def parse(self, word: str) -> bool:
        """True; raises a CommandError for any other word."""
        if word != self.name:
            raise CommandError(f"'{word}' is not understood here; leave it out or give: {self.name}")
        return True

    def check(self, value: bool) -> None:
        """Accepts either value."""


@dataclass(frozen=True)
class Choice:
    """An argument that is one of a few words."""

    field: str
    name: str
    words: tuple[str, ...]
    optional = False

    def parse(self, word: str) -> str:
        """The word itself, if it is one of them; raises a CommandError for any other."""
        self.check(word)
        return word

    def check(self, value: str) -> None:
        """Raises a CommandError where a word is none of them."""
        if value not in self.words:
            raise CommandError(f"{self.name} must be one of {', '.join(self.words)}, not '{value}'")


@dataclass(frozen=True)
class FurtherParts:
    """Arguments that are names of motions and numbers in turn, as many as there are; they come last."""

    field: str
    part: Text
    weight: Number
    most: int
    optional = True

    @property
    def name(self) -> str:
        """As in the help."""
        return f"{self.part.name} {self.weight.name} ..."

    def parse(self, words: Sequence[str]) -> tuple[tuple[str, float], ...]:
        """The names with their numbers; raises a CommandError where one has no number, or they are too many."""
        if len(words) % 2 or len(words) > 2 * self.most:
            raise CommandError(f"give each motion with its {self.weight.name}, at most {self.most} more of them")
        return tuple((self.part.parse(a), self.weight.parse(b)) for a, b in zip(words[::2], words[1::2], strict=True))

    def check(self, value: Sequence[tuple[str, float]]) -> None:
        """Raises a CommandError where one of them is not allowed."""
        if len(value) > self.most:
            raise CommandError(f"there are {len(value)} more motions; {self.most} more are the most")
        for name, number in value:
            self.part.check(name)
            self.weight.check(number)


TEMPO = Number("factor", "TEMPO", -3.0, 3.0)
TEMPO_SECONDS = Number("over", "SECONDS", 0.0, 60.0, optional=True)
STEP_SECONDS = Number("seconds", "SECONDS", 0.0, 1.0, optional=True)
PHASE = Number("phase", "PHASE", 0.0, 1.0)
WEIGHT = Number("weight", "WEIGHT", -0.3, 1.3)
PART = Number("weight", "WEIGHT", 0.0, 1.0)
CODE = Number("code", "CODE", 0.0, 999999.0, optional=True)
WITHIN = Number("within", "SECONDS", 0.0, 60.0)
AGO = Number("ago", "AGO", -2.0, 2.0, optional=True)
STEPS = Number("steps", "STEPS", 0, 16, optional=True, whole=True)
COUNT = Number("count", "COUNT", -32768, 65535, whole=True)
LOCK_PHASE = Number("phase", "PHASE", 0.0, 1.0, optional=True)
