"""Devices with a model number that are in no control table here: their names, and why they cannot be joints of a rig.

The numbers are those of the maker's own interface (ROBOTIS dynamixel_hardware_interface).
"""

from __future__ import annotations

_HAND = "it is a part of a hand, which its own controller drives"
_DRIVE = "it belongs to the wheels of a mobile base"
_NO_SERVO = "it is no servo"
_UNPUBLISHED = "of it the maker has published where its registers are, and neither limits nor gains nor its motor"

OTHER_DEVICES: dict[int, tuple[str, str]] = {
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
"""By model number."""
