"""The error byte of Protocol 1.0, whose frames are `plain_frames`.

It is a set of bits, of which three are about the servo itself, as in its hardware error status under Protocol 2.0, and
four about the instruction.
"""

from hardware.families.frames import BROADCAST, Frame, StatusPacket
from hardware.families.series import HEAT, OVERLOAD, VOLTAGE

_HARDWARE = VOLTAGE | HEAT | OVERLOAD
ANGLE_LIMIT, OUT_OF_RANGE, BAD_CHECKSUM, BAD_INSTRUCTION = 2, 8, 16, 64
ERROR_NUMBERS = {BAD_INSTRUCTION: 2, BAD_CHECKSUM: 3, OUT_OF_RANGE: 4, ANGLE_LIMIT: 6}
"""The error number that Protocol 2.0 has for the same."""


def as_status(frame: Frame) -> StatusPacket | None:
    """The answer that a frame carries; None where the sender cannot be a servo."""
    if frame.id >= BROADCAST:
        return None
    error = next((number for bit, number in ERROR_NUMBERS.items() if frame.instruction & bit), 0)
    hardware = frame.instruction & _HARDWARE
    return StatusPacket(frame.id, error, bool(hardware), frame.params, hardware)
