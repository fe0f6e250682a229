"""The facts of the Dynamixel servos of Protocol 2.0, and the names of the maker's other devices."""

import tomllib

from hardware.families.dynamixel2.family import FAMILY, TRAITS
from hardware.families.dynamixel2.tables import numbers, table
from hardware.families.facts import FamilyFacts, file_beside, parse_motors

_OTHERS = {
    int(number): (name, why)
    for why, devices in tomllib.loads(file_beside(__file__, "others.toml")).items()
    for number, name in devices.items()
}
FACTS = FamilyFacts(FAMILY, TRAITS, numbers, table, _OTHERS, parse_motors(file_beside(__file__, "motors.txt")))
