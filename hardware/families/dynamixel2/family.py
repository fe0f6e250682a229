"""The Dynamixel servos of Protocol 2.0 as a family."""

from hardware.families.dynamixel2 import frames, instructions
from hardware.families.dynamixel2.group_reply import group_read, status_length
from hardware.families.family import Family, Identification

FAMILY = Family(
    name="dynamixel2",
    spoken="",
    instructions=instructions,
    parser=frames.Parser,
    as_status=frames.as_status,
    status_length=status_length,
    trailer=frames.trailer,
    identification=Identification(number=0, firmware=2, length=3, by_ping=True),
    group_read=group_read,
    lines=lambda blocks: (blocks,),
    dialect="2.0",
    reboot=instructions.reboot,
    stuffed=frames.STUFFED_PATTERN,
    fast_reads=True,
    choice=("protocol_type", 2),
)
