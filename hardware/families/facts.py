"""The facts of a family: its models, their control tables and their traits."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from hardware.families.family import Family
from hardware.families.identified_motor import IdentifiedMotor
from hardware.families.table import ControlTable
from hardware.families.traits import Traits


@dataclass(frozen=True, slots=True)
class FamilyFacts:
    """The facts of a family.

    Attributes:
        family: what it is.
        traits: of the models that can be joints of a rig, by name.
        numbers: gives the number of each model whose control table is known.
        table: gives the control table of such a model.
        others: the names of its other devices, and why they cannot be joints of a rig, by model number.
        motors: of the models that were identified on real servos, by name.
    """

    family: Family
    traits: Mapping[str, Traits]
    numbers: Callable[[], Mapping[str, int]]
    table: Callable[[str], ControlTable]
    others: Mapping[int, tuple[str, str]] = field(default_factory=dict)
    motors: Mapping[str, IdentifiedMotor] = field(default_factory=dict)
