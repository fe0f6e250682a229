"""Scripts on the command line: "walk 4, jog 4, walk" plays walk for 4 s, then jog for 4 s, then walk for the rest."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from controller.errors import MotiondeckError, UnknownNameError


@dataclass(frozen=True)
class Cue:
    """A motion and when it is switched to, s after the start."""

    at: float
    motion: str


def parse_script(text: str, motions: Iterable[str]) -> list[Cue]:
    """The cues of a script; the first one is at 0 s.

    Args:
        text: motions separated by commas, each but the last followed by its seconds.
        motions: the names that may be used.

    Raises:
        MotiondeckError: naming the part of the script that is wrong and what it should be.
    """
    known = list(motions)
    cues: list[Cue] = []
    at = 0.0
    parts = [part.split() for part in text.split(",")]
    for place, words in enumerate(parts, start=1):
        last = place == len(parts)
        if not 1 <= len(words) <= 2:
            raise MotiondeckError(
                f"script, part {place}: '{' '.join(words)}' is not a motion and its seconds, as in 'walk 4'"
            )
        if words[0] not in known:
            raise UnknownNameError(f"script, part {place}: {UnknownNameError.among('motion', words[0], known)}")
        if len(words) == 1 and not last:
            raise MotiondeckError(
                f"script, part {place}: say for how long, as in '{words[0]} 4'; only the last may go on"
            )
        cues.append(Cue(at, words[0]))
        at += _seconds(words[1], place) if len(words) == 2 else 0.0
    return cues


def _seconds(word: str, place: int) -> float:
    try:
        seconds = float(word)
    except ValueError:
        seconds = -1.0
    if not 0.0 < seconds < 1e6:
        raise MotiondeckError(f"script, part {place}: '{word}' is not a number of seconds above 0")
    return seconds
