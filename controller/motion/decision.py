"""A decision about a recording: what was decided, on which evidence, and what overrules it."""

from dataclasses import dataclass
from typing import Literal

Step = Literal["people", "body", "unit", "up axis", "rate", "ground", "cuts", "kind", "ends"]


@dataclass(frozen=True)
class Decision:
    """One step's decision about a recording."""

    step: Step
    decided: str  # in words
    evidence: str  # the figures that it rests on
    overrule: str  # the option or the key of a recipe that overrules it
    notable: bool = False  # something was changed or is doubtful, so that reports of many recordings show it

    def __str__(self) -> str:
        remedy = f"; otherwise: {self.overrule}" if self.overrule else ""
        return f"{self.step}: {self.decided} ({self.evidence}{remedy})"
