"""The facts of the Feetech STS servos."""

from hardware.families.facts import FamilyFacts
from hardware.families.feetech.family import FAMILY
from hardware.families.feetech.sts3215 import STS3215
from hardware.families.feetech.traits import TRAITS

_TABLES = {table.model: table for table in (STS3215,)}
_NUMBERS = {model: table.number for model, table in _TABLES.items()}

FACTS = FamilyFacts(FAMILY, TRAITS, lambda: _NUMBERS, _TABLES.__getitem__)
