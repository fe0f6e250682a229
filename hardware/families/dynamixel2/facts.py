"""The facts of the Dynamixel servos of Protocol 2.0."""

from hardware.families.dynamixel2.family import FAMILY
from hardware.families.dynamixel2.other_devices import OTHER_DEVICES
from hardware.families.dynamixel2.tables import numbers, table
from hardware.families.dynamixel2.traits import TRAITS
from hardware.families.facts import FamilyFacts
from hardware.families.identified_motor import parse_motors
from hardware.families.rows import file_beside

FACTS = FamilyFacts(FAMILY, TRAITS, numbers, table, OTHER_DEVICES, parse_motors(file_beside(__file__, "motors.txt")))
