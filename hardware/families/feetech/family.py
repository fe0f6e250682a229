"""The Feetech STS servos as a family; a group read of them is a sync read, answered in one status a servo."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hardware.families import plain_frames as instructions
from hardware.families.family import Family, Identification
from hardware.families.frames import BROADCAST, Frame, StatusPacket
from hardware.families.plain_frames import BEFORE, HEADER, PlainParser, status_length, trailer
from hardware.families.replies import Blocks, GroupRead, WholeReply, in_order, whole_reply
from hardware.families.series import HEAT, OVERLOAD, VOLTAGE

_HARDWARE = VOLTAGE | HEAT | OVERLOAD  # what the same bits mean elsewhere
_PROBLEMS = 0xFF  # all bits of the error byte are about the servo itself


def as_status(frame: Frame) -> StatusPacket | None:
    """The answer that a frame carries; None where the sender cannot be a servo."""
    bits = frame.instruction
    if frame.id >= BROADCAST:
        return None
    return StatusPacket(frame.id, 0, bits != 0, frame.params, bits & _HARDWARE)


def lines(blocks: Blocks) -> Iterator[Blocks]:
    """Blocks in parts of the same registers, which one sync read can be about."""
    for place in dict.fromkeys(block[1:] for block in blocks):
        yield tuple(block for block in blocks if block[1:] == place)


def group_read(blocks: Blocks, fast: bool) -> GroupRead:
    """A read of one servo, or a sync read of several; ValueError if they are asked for different registers."""
    ids = bytes(id for id, _, _ in blocks)
    _, address, length = blocks[0]
    if any(block[1:] != (address, length) for block in blocks):
        raise ValueError("a sync read is about the same registers of all")
    frame = instructions.read(*blocks[0]) if len(ids) == 1 else instructions.sync_read(address, length, ids)
    heads = np.frombuffer(b"".join(HEADER + bytes((id, length + 2)) for id in ids), dtype=np.uint8).reshape(-1, BEFORE)
    lengths, stride = (length,) * len(ids), status_length(length)
    parts = partial(in_order, PlainParser, as_status, ids, lengths)
    return GroupRead(frame, False, ids, lengths, partial(_whole, heads, stride), len(ids) * stride, parts)


def _whole(heads: NDArray[np.uint8], stride: int, received: bytes) -> WholeReply | None:
    """The statuses, which begin with `heads`, if all are there, undamaged and alone; else None."""
    if len(received) != len(heads) * stride:
        return None
    rows = np.frombuffer(received, dtype=np.uint8).reshape(-1, stride)
    # A checksum is the inverse of the sum before it: with it, each sum ends in FF.
    if not np.array_equal(rows[:, :BEFORE], heads) or (np.add.reduce(rows[:, 2:], 1, np.uint8) != 0xFF).any():
        return None
    return whole_reply((received, stride, BEFORE, BEFORE + 1, _PROBLEMS, 1))


FAMILY = Family(
    name="feetech",
    spoken=" as a Feetech servo",
    instructions=instructions.INSTRUCTIONS,
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
