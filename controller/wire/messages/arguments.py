"""The kinds of arguments of commands, the ranges of their values, and the weights of a blend."""

from collections.abc import Sequence
from dataclasses import dataclass

from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import shortened

LONGEST_NAME = 100


class CommandError(MotiondeckError):
    """A command that cannot be read, or an argument out of its range; the message names what is allowed."""


@dataclass(frozen=True)
class Text:
    """A name or a path; `what` describes it in errors."""

    name: str
    what: str
    longest: int = LONGEST_NAME

    def parse(self, word: str) -> str:
        """The word itself."""
        return word

    def check(self, value: str) -> None:
        """Raises a CommandError for an empty or too long text, and for undecodable bytes of a command line."""
        if not 0 < len(value) <= self.longest:
            raise CommandError(f"{self.what} has 1 to {self.longest} characters")
        try:
            value.encode()
        except UnicodeEncodeError:
            raise CommandError(f"{self.what} is text in UTF-8, not {value!a}") from None


@dataclass(frozen=True)
class MotionName(Text):
    """The name of a motion of the deck's library."""

    name: str = "MOTION"
    what: str = "the name of a motion"


@dataclass(frozen=True)
class Number:
    """A number from `lowest` to `highest`; with `whole` an integer."""

    name: str
    lowest: float
    highest: float
    whole: bool = False

    def parse(self, word: str) -> float:
        """The number; raises a CommandError where the word is none."""
        try:
            value = int(word) if self.whole else float(word)
            float(value)
        except (ValueError, OverflowError):
            raise CommandError(self._range(f"'{shortened(word)}'")) from None
        return value

    def check(self, value: float) -> None:
        """Raises a CommandError where a number is outside the range or not finite."""
        if not self.lowest <= value <= self.highest:
            raise CommandError(self._range(f"{value:g}"))

    def _range(self, value: str) -> str:
        kind = "a whole number" if self.whole else "a number"
        return f"{self.name} must be {kind} from {self.lowest:g} to {self.highest:g}, not {value}"


@dataclass(frozen=True)
class Flag:
    """A word that is typed or left out."""

    name: str

    def parse(self, word: str) -> bool:
        """True; raises a CommandError for any other word."""
        if word != self.name:
            raise CommandError(f"'{shortened(word)}' is not understood here; leave it out or give: {self.name}")
        return True

    def check(self, value: bool) -> None:
        """Accepts either value."""


@dataclass(frozen=True)
class Choice:
    """One of a few words."""

    name: str
    words: tuple[str, ...]

    def parse(self, word: str) -> str:
        """The word itself; raises a CommandError if it is not one of them."""
        self.check(word)
        return word

    def check(self, value: str) -> None:
        """Raises a CommandError if a word is not one of them."""
        if value not in self.words:
            raise CommandError(f"{self.name} must be one of {', '.join(self.words)}, not '{shortened(value)}'")


@dataclass(frozen=True)
class WholeCommand:
    """A command, typed as one word; `command_table` parses it, and its own `check` checks it."""

    name: str

    def check(self, value: object) -> None:
        """Accepts any command."""


@dataclass(frozen=True)
class WeightedMotions:
    """At most `most` motions, each followed by its weight; the last argument of its command."""

    motion: MotionName
    weight: Number
    most: int

    @property
    def name(self) -> str:
        """Its name in the help."""
        return f"{self.motion.name} {self.weight.name} ..."

    def parse(self, words: Sequence[str]) -> tuple[tuple[str, float], ...]:
        """The motions with their weights; raises a CommandError where a weight is missing, or there are too many."""
        if len(words) % 2 or len(words) > 2 * self.most:
            raise CommandError(f"give each motion with its {self.weight.name}, at most {self.most} more of them")
        return tuple((self.motion.parse(a), self.weight.parse(b)) for a, b in zip(words[::2], words[1::2], strict=True))

    def check(self, value: Sequence[tuple[str, float]]) -> None:
        """Raises a CommandError where one of them is not allowed."""
        if len(value) > self.most:
            raise CommandError(f"there are {len(value)} more motions; {self.most} more are the most")
        for name, number in value:
            self.motion.check(name)
            self.weight.check(number)


Argument = Text | Number | Flag | Choice | WholeCommand | WeightedMotions

TEMPO = Number("TEMPO", -3.0, 3.0)
TEMPO_SECONDS = Number("SECONDS", 0.0, 60.0)
STEP_SECONDS = Number("SECONDS", 0.0, 1.0)
PHASE = Number("PHASE", 0.0, 1.0)
WEIGHT = Number("WEIGHT", -0.3, 1.3)
PART = Number("WEIGHT", 0.0, 1.0)
HOLD_SECONDS = Number("SECONDS", 0.05, 3600.0)
HELD = 0.5  # s that a live value holds unless it says otherwise
AGO = Number("AGO", -2.0, 2.0)
STEPS = Number("STEPS", 0, 16, whole=True)
MOST_BLENDED = 4  # the most motions of a blend


def blend_weights(first: str, second: str, weight: float, also: Sequence[tuple[str, float]] = ()) -> dict[str, float]:
    """The weights of the motions of a blend, the first with what is left; CommandError says what is allowed."""
    parts = [(second, weight), *also]
    names = [first, *(name for name, _ in parts)]
    for name in names:
        if names.count(name) > 1:
            raise CommandError(f"a blend takes two motions or more, not {name} twice")
    if len(names) > MOST_BLENDED:
        raise CommandError(f"a blend takes at most {MOST_BLENDED} motions, not {len(names)}")
    for _, part in parts:
        (PART if also else WEIGHT).check(part)
    rest = 1.0 - sum(part for _, part in parts)
    if also and rest < -1e-9:
        raise CommandError(f"the weights of a blend sum to at most 1, not to {1.0 - rest:g}; {first} has what is left")
    return {first: rest if abs(rest) > 1e-9 else 0.0} | dict(parts)


def described(first: str, blend: Sequence[tuple[str, float]]) -> str:
    """A motion and what is blended into it, in words: "walk with 0.30 of jog and 0.20 of waltz"."""
    parts = [f"{weight:.2f} of {name}" for name, weight in blend]
    return f"{first} with {' and '.join(parts)}" if parts else first
