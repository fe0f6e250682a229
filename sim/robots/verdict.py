"""The verdict on a motion that a robot is to play, in the one vocabulary of learning, retargeting, preflight and play.

A verdict has one of three answers, "plays", "at tempo 0.54" and "does not fit", with the findings that are the reason.
Each finding belongs to one question (`QUESTIONS`).
"""

import tomllib
from collections.abc import Callable, Iterable, Sequence
from math import sqrt
from pathlib import Path
from typing import Any

import msgspec

LEGS_LEFT_OUT = "legs left out"  # the check of a robot without legs, which informs

QUESTIONS: dict[str, tuple[str, ...]] = {
    "carried": ("carried wrongly", "trunk leans elsewhere", "self-collision", "jumps", "broken", "into the ground"),
    "in reach": ("out of reach", "at a joint's end"),
    "keeps up": ("held back", "speed", "torque", "servo lag", "off target"),
    "on its feet": ("falls", "off balance", "balance margin", "foot slide", "capture point off"),
    "cool": ("heat in 10 min", "heat of walking"),
}
"""What a verdict answers, each with its checks."""

REMEDIES: dict[str, str] = tomllib.loads(Path(__file__).with_name("remedies.toml").read_text(encoding="utf-8"))
"""What helps when no slower tempo does."""

AT_ANY_TEMPO = ("out of reach", "self-collision", "jumps", "broken", "into the ground")  # checks that no tempo mends
SLOWEST = 0.1  # the lowest tempo to judge at


class Finding(msgspec.Struct, frozen=True):
    """One number of a verdict."""

    check: str
    value: float
    limit: float | None  # the largest value that passes; None if the number only informs
    unit: str
    where: str = ""  # the joint, limb or bodies concerned, or ""
    ok: bool = True  # whether it is within its limit
    cause: str = ""  # of a failure even at the slowest tempo, or ""

    @property
    def words(self) -> str:
        """The finding as text: "held back: l_knee, 0.31 rad"."""
        return f"{self.check}: {', '.join(filter(None, (self.where, self.figure)))}"

    @property
    def figure(self) -> str:
        """Its number with the unit; "" without a unit."""
        digits = 2 if abs(self.value) < 10.0 and self.value % 1.0 else 0
        return f"{self.value:.{digits}f} {self.unit}" if self.unit else ""


def limited(check: str, value: float, limit: float | None, unit: str, where: str = "") -> Finding:
    """A finding that is within its limit, if it has one, or not."""
    return Finding(check, value, limit, unit, where, ok=limit is None or value <= limit)


class RobotVerdict(msgspec.Struct, frozen=True):
    """The verdict on one motion, switch or recording on one robot."""

    name: str
    findings: tuple[Finding, ...]
    passes_at: float | None  # the largest passing tempo, up to the judged one; None if no tempo passes
    way: tuple[str, ...] = ()  # the intermediate motions of a switch that is judged by its parts
    obstacles: tuple[Finding, ...] = ()  # if no tempo passes, the findings that fail even at the slowest
    tempo: float = 1.0  # at which it is judged

    @property
    def ok(self) -> bool:
        """Whether all findings pass at the judged tempo."""
        return all(finding.ok for finding in self.findings)

    @property
    def troubles(self) -> tuple[Finding, ...]:
        """The findings beyond their limits."""
        return tuple(finding for finding in self.findings if not finding.ok)

    @property
    def answer(self) -> str:
        """The answer: "plays", "at tempo 0.54" (the fastest that passes) or "does not fit"."""
        if self.passes_at is None:
            return "does not fit"
        return "plays" if self.ok and self.tempo == 1.0 else f"at tempo {self.passes_at:.2f}"

    @property
    def words(self) -> str:
        """The answer with its reasons."""
        reasons = self.obstacles if self.passes_at is None else self.troubles
        left_out = f", {LEGS_LEFT_OUT}" if any(finding.check == LEGS_LEFT_OUT for finding in self.findings) else ""
        return self.answer + left_out + (f" ({'; '.join(finding.words for finding in reasons)})" if reasons else "")

    def answer_to(self, question: str) -> str:
        """The answer to one of QUESTIONS: "yes", what is beyond its limit, or "not judged"."""
        mine = [finding for finding in self.findings if finding.check in QUESTIONS[question]]
        beyond = [finding.words for finding in mine if not finding.ok]
        judged = any(finding.limit is not None for finding in mine)
        return "; ".join(beyond) or ("yes" if judged else "not judged")

    def row(self) -> dict[str, Any]:
        """The verdict for scripts; a switch by way of other motions has its findings in the rows of its parts."""
        fields = msgspec.to_builtins(self) | {"findings": [] if self.way else msgspec.to_builtins(self.findings)}
        fields |= {"ok": self.ok, "troubles": sorted({finding.check for finding in self.troubles})}
        answers = {question: self.answer_to(question) for question in QUESTIONS}
        return fields | {"answer": self.answer, "words": self.words, "answers": answers}


def verdict_of(name: str, found: Sequence[Finding], at: Callable[[float], Iterable[Finding]]) -> RobotVerdict:
    """The verdict of findings at tempo 1; where those at a slower tempo may pass, the fastest that does is searched."""
    troubles = tuple(finding for finding in found if not finding.ok)
    never = tuple(finding for finding in troubles if finding.check in AT_ANY_TEMPO)
    if never or not troubles:
        return RobotVerdict(name, tuple(found), None if never else 1.0, obstacles=never)
    tempo = fastest_passing(lambda tempo: all(finding.ok for finding in at(tempo)), 1.0)
    return RobotVerdict(name, tuple(found), tempo, obstacles=troubles if tempo is None else ())


def summed(verdicts: Iterable[RobotVerdict]) -> str:
    """The number of verdicts with each answer: "4 play, 8 at a slower tempo, 3 do not fit"."""
    every = list(verdicts)
    plays, never = (sum(one.answer == answer for one in every) for answer in ("plays", "does not fit"))
    counts = (plays, "play"), (len(every) - plays - never, "at a slower tempo"), (never, "do not fit")
    return ", ".join(f"{count} {words}" for count, words in counts if count)


def fastest_passing(passes: Callable[[float], bool], tempo: float, within: float = 1.1) -> float | None:
    """The fastest passing tempo from SLOWEST to below the given one, to a ratio `within`, by bisection; None without.

    Where passing tempos have gaps, it is the upper end of one of their stretches.
    """
    low, high = SLOWEST, tempo
    while high > within * low:
        middle = sqrt(low * high)
        low, high = (middle, high) if passes(middle) else (low, middle)
    # The slowest tempo takes longest to check, and is rarely needed.
    return low if low > SLOWEST or passes(SLOWEST) else None
