"""The facts of the Dynamixel servos of Protocol 2.0, and the names of the maker's other devices."""

from hardware.families.dynamixel2.family import FAMILY
from hardware.families.dynamixel2.tables import numbers, table
from hardware.families.dynamixel2.traits import TRAITS
from hardware.families.facts import FamilyFacts
from hardware.families.identified_motor import parse_motors
from hardware.families.rows import file_beside

_HAND = "it is a part of a hand, which its own controller drives"
_DRIVE = "it belongs to the wheels of a mobile base"
_NO_SERVO = "it is no servo"
_UNPUBLISHED = "of it the maker has published where its registers are, and neither limits nor gains nor its motor"

# Those in no control table here, by model number as in the maker's own interface (dynamixel_hardware_interface): their
# names, and why they cannot be joints of a rig.
_OTHER_DEVICES: dict[int, tuple[str, str]] = {
    220: ("OMY-HAT", _NO_SERVO),
    230: ("OMY-END", _NO_SERVO),
    231: ("OMY-END-RH-P12-RN", "it is a gripper, which has no position mode"),
    260: ("HX5-D20-RR", _HAND),
    261: ("HX5-D20-RL", _HAND),
    536: ("SensorXEL joystick", _NO_SERVO),
    537: ("FFW-G40-IMU", _NO_SERVO),
    600: ("SensorXEL joystick", _NO_SERVO),
    601: ("FFW-G10-LED", _NO_SERVO),
    602: ("FFW-G10-RCU", _NO_SERVO),
    **{620 + wheel: (f"FFW-SG2-STEER-{wheel + 1}", _DRIVE) for wheel in range(3)},
    **{623 + wheel: (f"FFW-SG2-DRIVE-{wheel + 1}", _DRIVE) for wheel in range(3)},
    1700: ("XM335-T332", _UNPUBLISHED),  # named XC335-T332 at first
    35075: ("HX2-D1-PNS", _UNPUBLISHED),
    **{6000 + part: (f"HX5-D20 part {part}", _HAND) for part in range(1, 26)},
}

FACTS = FamilyFacts(FAMILY, TRAITS, numbers, table, _OTHER_DEVICES, parse_motors(file_beside(__file__, "motors.txt")))
