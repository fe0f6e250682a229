"""The Dynamixel servos of Protocol 1.0 as a family; their frames are `plain_frames`.

Three bits of an error byte are about the servo itself, as in its hardware error status under Protocol 2.0, and four
about the instruction.
"""

from functools import partial

from hardware.families import plain_frames as instructions
from hardware.families.family import Family, Identification
from hardware.families.frames import BROADCAST, Frame, StatusPacket
from hardware.families.plain_frames import PlainParser, status_length, trailer
from hardware.families.replies import Blocks, GroupRead, in_order
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


def _group_read(blocks: Blocks, fast: bool) -> GroupRead:
    """A read of one servo, or a bulk read, which only MX servos know."""
    lengths = tuple(length for _, _, length in blocks)
    ids = bytes(id for id, _, _ in blocks)
    frame = instructions.read(*blocks[0]) if len(blocks) == 1 else instructions.bulk_read(blocks)
    needed = len(ids) * status_length(0) + sum(lengths)
    parts = partial(in_order, PlainParser, as_status, ids, lengths)
    return GroupRead(frame, False, ids, lengths, None, needed, parts)


FAMILY = Family(
    name="dynamixel1",
    spoken=" in Protocol 1.0",
    instructions=instructions.INSTRUCTIONS,
    parser=PlainParser,
    as_status=as_status,
    status_length=status_length,
    trailer=trailer,
    identification=Identification(number=0, firmware=2, length=4, by_ping=False, id=3),
    group_read=_group_read,
    lines=lambda blocks: ((block,) for block in blocks),
    dialect="1.0",
    reboot=instructions.reboot,
    mirrors=True,
    choice=("protocol_type", 1),
    mute_model="AX-12A",
)
