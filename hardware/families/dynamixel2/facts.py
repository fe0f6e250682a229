"""The facts of the Dynamixel servos of Protocol 2.0."""

from hardware.families.dynamixel2.family import FAMILY
from hardware.families.dynamixel2.identified import MOTORS
from hardware.families.dynamixel2.other_devices import OTHER_DEVICES
from hardware.families.dynamixel2.tables import numbers, table
from hardware.families.dynamixel2.traits import TRAITS
from hardware.families.facts import FamilyFacts

FACTS = FamilyFacts(FAMILY, TRAITS, numbers, table, OTHER_DEVICES, MOTORS)
