"""The facts of the Feetech STS servos."""

from hardware.families.facts import FamilyFacts
from hardware.families.feetech.family import FAMILY
from hardware.families.feetech.traits import TRAITS
from hardware.families.rows import file_beside
from hardware.families.table import parse_table

_STS3215 = parse_table("STS3215", 777, 4096, file_beside(__file__, "sts3215.txt"), TRAITS["STS3215"].series)
_TABLES = {_STS3215.model: _STS3215}
_NUMBERS = {model: table.number for model, table in _TABLES.items()}

FACTS = FamilyFacts(FAMILY, TRAITS, lambda: _NUMBERS, _TABLES.__getitem__)
