"""The facts of the Dynamixel servos of Protocol 1.0."""

from hardware.families.dynamixel1.ax_rx_mx import AX_RX_MX
from hardware.families.dynamixel1.family import FAMILY
from hardware.families.dynamixel1.traits import TRAITS
from hardware.families.facts import FamilyFacts
from hardware.families.identified_motor import parse_motors
from hardware.families.rows import file_beside

_NUMBERS = {model: table.number for model, table in AX_RX_MX.items()}

FACTS = FamilyFacts(
    FAMILY,
    TRAITS,
    lambda: _NUMBERS,
    AX_RX_MX.__getitem__,
    motors=parse_motors(file_beside(__file__, "motors.txt")),
)
