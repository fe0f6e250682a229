"""The Feetech STS servos as a family."""

from hardware.families import plain_instructions as instructions
from hardware.families.family import Family, Identification
from hardware.families.feetech.group_reply import as_status, group_read, lines
from hardware.families.plain_frames import PlainParser, status_length, trailer

FAMILY = Family(
    name="feetech",
    spoken=" as a Feetech servo",
    instructions=instructions,
    parser=PlainParser,
    as_status=as_status,
    status_length=status_length,
    trailer=trailer,
    identification=Identification(number=3, firmware=0, length=6, by_ping=False, id=5),
    group_read=group_read,
    lines=lines,
    dialect="1.0",
    mirrors=True,
    eeprom_lock="lock",
    answers_all=1,
)
