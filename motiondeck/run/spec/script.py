"""Scripts: "walk 4, jog 4, walk" on the command line, or a timeline of any commands in a file.

motion = "walk"              # what is played first

[[commands]]
at = 4.0                     # s since play began
say = "switch jog"           # a command as typed at the prompt
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import msgspec

from controller.wire.messages.arguments import CommandError
from controller.wire.messages.command_table import BY_WORD, parse_command
from controller.wire.messages.commands import DeckCommand
from motiondeck_base.errors import FileFormatError, MotiondeckError, UnknownNameError
from motiondeck_base.toml_file import read_toml


@dataclass(frozen=True)
class Cue:
    """A motion and when it is switched to, s after the start."""

    at: float
    motion: str


@dataclass(frozen=True)
class Timed:
    """A command and when it is given, s after the start."""

    at: float
    message: DeckCommand


class _Line(msgspec.Struct, forbid_unknown_fields=True):
    at: float
    say: str


class _File(msgspec.Struct, forbid_unknown_fields=True):
    motion: str
    commands: list[_Line] = []


def read_timeline(path: Path, motions: Iterable[str]) -> tuple[str, list[Timed]]:
    """The first motion of a timeline file, and its commands in the order of their times; it may name these motions.

    FileFormatError names the file, the command that is wrong, and what it should be.
    """
    known = list(motions)
    file = read_toml(path, _File)
    if file.motion not in known:
        raise FileFormatError(f"{path}: {UnknownNameError.among('motion', file.motion, known)}")
    timeline: list[Timed] = []
    for number, line in enumerate(file.commands, start=1):
        place = f"{path}, command {number}"
        if line.at < 0.0:
            raise FileFormatError(f"{place}: at = {line.at} is not a number of seconds from 0 on")
        try:
            message = parse_command(line.say.split())
            message.row.check_use("script")
        except CommandError as error:
            raise FileFormatError(f"{place}: {error}") from None
        for name in message.motions:
            if name not in known:
                raise FileFormatError(f"{place}: {UnknownNameError.among('motion', name, known)}")
        timeline.append(Timed(line.at, message))
    return file.motion, sorted(timeline, key=lambda timed: timed.at)


def parse_script(text: str, motions: Iterable[str]) -> tuple[list[Cue], float | None]:
    """The cues of a script, the first one at 0 s, and its length in s, if its last part gives seconds.

    It is motions separated by commas, each but the last followed by its seconds; those of the last may be left out.
    MotiondeckError names the part that is wrong and what it should be.
    """
    known = list(motions)
    cues: list[Cue] = []
    at = 0.0
    parts = [part.split() for part in text.split(",")]
    for place, words in enumerate(parts, start=1):
        last = place == len(parts)
        if words and words[0] not in known and (words[0] in BY_WORD or Path(words[0]).suffix):
            raise MotiondeckError(
                f"script, part {place}: '{words[0]}' is no motion. Commands go into a timeline file, whose name ends "
                "in .toml (docs/deck.md, Timeline files)"
            )
        if not 1 <= len(words) <= 2:
            raise MotiondeckError(
                f"script, part {place}: '{' '.join(words)}' is not a motion and its seconds, as in 'walk 4'"
            )
        if words[0] not in known:
            raise UnknownNameError(f"script, part {place}: {UnknownNameError.among('motion', words[0], known)}")
        if len(words) == 1 and not last:
            raise MotiondeckError(
                f"script, part {place}: give its seconds, as in '{words[0]} 4'; only the last part may go without"
            )
        cues.append(Cue(at, words[0]))
        at += _seconds(words[1], place) if len(words) == 2 else 0.0
    return cues, at if at > cues[-1].at else None


def _seconds(word: str, place: int) -> float:
    try:
        seconds = float(word)
    except ValueError:
        seconds = -1.0
    if not 0.0 < seconds < 1e6:
        raise MotiondeckError(f"script, part {place}: '{word}' is not a number of seconds above 0")
    return seconds
