"""The Dynamixel servos of Protocol 1.0 as a family."""

from functools import partial

from hardware.families import plain_instructions as instructions
from hardware.families.dynamixel1 import frames
from hardware.families.family import Family, Identification
from hardware.families.plain_frames import PlainParser, status_length, trailer
from hardware.families.replies import Blocks, GroupRead, in_order


def _group_read(blocks: Blocks, fast: bool) -> GroupRead:
    """A read of one servo, or a bulk read, which only MX servos know."""
    lengths = tuple(length for _, _, length in blocks)
    ids = bytes(id for id, _, _ in blocks)
    frame = instructions.read(*blocks[0]) if len(blocks) == 1 else instructions.bulk_read(blocks)
    needed = len(ids) * status_length(0) + sum(lengths)
    parts = partial(in_order, PlainParser, frames.as_status, ids, lengths)
    return GroupRead(frame, False, ids, lengths, None, needed, parts)


FAMILY = Family(
    name="dynamixel1",
    spoken=" in Protocol 1.0",
    instructions=instructions,
    parser=PlainParser,
    as_status=frames.as_status,
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
