"""The facts of a family: its models, their control tables and their traits."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from hardware.families.family import Family
from hardware.families.identified_motor import IdentifiedMotor
from hardware.families.table import ControlTable
from hardware.families.traits import Traits


@dataclass(frozen=True, slots=True)
class FamilyFacts:
    """The facts of a family."""

    family: Family
    traits: Mapping[str, Traits]  # of the models that can be joints of a rig, by name
    numbers: Callable[[], Mapping[str, int]]  # gives the number of each model whose control table is known
    table: Callable[[str], ControlTable]  # gives the control table of such a model
    # The names of its other devices, and why they cannot be joints of a rig, by model number.
    others: Mapping[int, tuple[str, str]] = field(default_factory=dict)
    # Of the models that were identified on real servos, by name.
    motors: Mapping[str, IdentifiedMotor] = field(default_factory=dict)
