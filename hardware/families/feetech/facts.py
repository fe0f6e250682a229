"""The facts of the Feetech STS servos.

Bits of problems are those of register 65; current is a kind of overload. Bit 2 of `phase` makes a count of speed one
step/s, and without bit 4 a position begins anew after a turn.
"""

from types import MappingProxyType

from hardware.families.facts import FamilyFacts, file_beside, parse_traits
from hardware.families.feetech.family import FAMILY
from hardware.families.series import ENCODER, HEAT, OVERLOAD, VOLTAGE, Series
from hardware.families.table import parse_table

_STS = Series(
    "STS",
    FAMILY,
    baud_rates=MappingProxyType(dict(enumerate((1_000_000, 500_000, 250_000, 128_000, 115200, 76800, 57600, 38400)))),
    problems=MappingProxyType({VOLTAGE: 1, ENCODER: 2, HEAT: 4, OVERLOAD: 8 | 32}),
    reboots=False,
    modes=(3,),
    current_limited=(),
    offset_subtracts=True,
    wraps=True,
    bits_needed=MappingProxyType({"phase": (4 | 16, 4)}),
)

TRAITS = parse_traits(file_beside(__file__, "models.txt"), {_STS.name: _STS})  # by model name

_STS3215 = parse_table("STS3215", 777, 4096, file_beside(__file__, "sts3215.txt"), TRAITS["STS3215"].series)
_TABLES = {_STS3215.model: _STS3215}
_NUMBERS = {model: table.number for model, table in _TABLES.items()}

FACTS = FamilyFacts(FAMILY, TRAITS, lambda: _NUMBERS, _TABLES.__getitem__)
