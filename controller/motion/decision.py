"""Decisions about a recording: what was decided, on which evidence, and what overrules it."""

from dataclasses import dataclass
from typing import Literal

Step = Literal["people", "body", "unit", "up axis", "rate", "ground", "cuts", "kind", "ends"]
_UNIT_NAMES = {
    1.0: "m",
    0.01: "cm",
    0.001: "mm",
    0.0254: "inches",
    0.0254 / 0.45: "inches / 0.45 (CMU's)",
    0.3048: "feet",
}


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


def unit_name(unit: float) -> str:
    """The name of a unit of length in m."""
    return _UNIT_NAMES.get(unit, f"{unit:g} m")


def unit_decision(unit: float, other: float | None, leg: float, given: float | None, fixed: float | None) -> Decision:
    """Of a file's unit, m, with a leg of `leg` m, `given` by option or `fixed` by the format; `other` fits too."""
    why = "as given" if given else "the format's" if fixed else f"a leg is then {leg:.2f} m long"
    if other is not None:
        why += f"; in {unit_name(other)} it is {leg * other / unit:.2f} m, which fits too"
    remedy = "--unit METRES" if other is None else f"--unit {other:.4g}"
    return Decision("unit", unit_name(unit), why, remedy, notable=other is not None)


def up_decision(up: str, given: str | None, fixed: str | None) -> Decision:
    """The decision about the vertical axis of a file."""
    why = "as given" if given else "the format's" if fixed else "the body stands along it and touches the ground"
    return Decision("up axis", up, why, "--up y or z")
