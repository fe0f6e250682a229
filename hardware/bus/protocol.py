"""The two protocols of the bus, as values that tell their differences."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import ModuleType

from hardware.families.dynamixel1 import frames as frames1
from hardware.families.dynamixel1 import instructions as instructions1
from hardware.families.dynamixel2 import frames as frames2
from hardware.families.dynamixel2 import group_reply
from hardware.families.dynamixel2 import instructions as instructions2
from hardware.families.dynamixel2.frames import Frame, Parser, StatusPacket


@dataclass(frozen=True, slots=True)
class Protocol:
    """A protocol.

    Attributes:
        version: 1 or 2.
        instructions: builds their frames; those of the same name have the same arguments.
        parser: finds frames in received bytes.
        as_status: the status that a frame carries, or None.
        status_length: bytes of a status with some parameter bytes.
        trailer: the checksum of a frame without it.
        stuffed: whether a pattern in a frame's body needs byte stuffing.
        group_reads: whether every servo answers sync and bulk reads, and a ping tells model and firmware.
    """

    version: int
    instructions: ModuleType
    parser: type[Parser]
    as_status: Callable[[Frame], StatusPacket | None]
    status_length: Callable[[int], int]
    trailer: Callable[[bytes | bytearray], bytes]
    stuffed: bool
    group_reads: bool

    def statuses(self, received: bytes) -> Iterator[StatusPacket]:
        """The statuses in received bytes."""
        return (status for frame in self.parser().feed(received) if (status := self.as_status(frame)) is not None)


_FRAMES1 = (frames1.Parser1, frames1.as_status, frames1.status_length, frames1.trailer)
_FRAMES2 = (Parser, frames2.as_status, group_reply.status_length, frames2.trailer)

PROTOCOLS = {
    1: Protocol(1, instructions1, *_FRAMES1, stuffed=False, group_reads=False),
    2: Protocol(2, instructions2, *_FRAMES2, stuffed=True, group_reads=True),
}
"""By version."""
