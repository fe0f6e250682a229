"""A servo family as a value: its frames, group reads, identity and locks. The bus and the rig work on this alone."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

from hardware.families.frames import Frame, FrameParser, StatusPacket
from hardware.families.replies import Blocks, GroupRead


class Instructions(Protocol):
    """The instructions that every family has, each as the bytes of one frame."""

    def ping(self, id: int) -> bytes:
        """Asks whether a servo is there."""
        ...

    def read(self, id: int, address: int, length: int) -> bytes:
        """Asks one servo for `length` bytes of its control table."""
        ...

    def write(self, id: int, address: int, data: bytes) -> bytes:
        """Writes bytes into a servo's control table."""
        ...

    def sync_write(self, address: int, length: int, entries: bytes) -> bytes:
        """Writes the same registers of many servos at once, unanswered; entries are ID and `length` bytes, repeated."""
        ...


@dataclass(frozen=True, slots=True)
class Identification:
    """Where a servo tells what it is: in its answer to a ping, or in its first registers.

    Attributes:
        number, firmware: where the model number (2 bytes) and the firmware version stand.
        length: bytes of an answer to a ping with these, or how many registers to read from address 0 on.
        by_ping: whether the answer to a ping has them.
        id: where its own ID stands, which distinguishes families with the same frames; None without.
    """

    number: int
    firmware: int
    length: int
    by_ping: bool
    id: int | None = None

    def read(self, data: bytes) -> tuple[int, int]:
        """Model number and firmware version."""
        return data[self.number] | data[self.number + 1] << 8, data[self.firmware]


@dataclass(frozen=True, slots=True, eq=False)
class Family:
    """A servo family.

    Attributes:
        name: of its folder.
        spoken: an addition to a sentence about one of its servos, "" for the usual family.
        instructions: builds its frames.
        parser: finds frames in received bytes.
        as_status: the status that a frame carries, or None.
        status_length: bytes of a status with some parameter bytes.
        trailer: the checksum of a frame without it.
        identification: where a servo tells its model.
        group_read: reads (id, address, length) of each of several servos in one request, in one joint reply if asked.
        lines: blocks in the parts that one group read can be about, whatever their models.
        dialect: the same for families whose pings and answers look alike.
        reboot: the instruction that restarts a servo of a series that can be, or None.
        stuffed: a pattern that a frame's body must not have as it is; b"" for none.
        fast_reads: whether some of its models answer group reads jointly.
        mirrors: whether an instruction looks like an answer, so that an adapter's echo does too.
        choice: register and value by which a servo that knows several families is set to this one, or None.
        eeprom_lock: the register that is 0 while EEPROM keeps what is written; "" where torque locks it.
        answers_all: the status return level at which every instruction is answered.
        mute_model: a model in which torque and status return level stand where they do in all that may be mute, or "".
    """

    name: str
    spoken: str
    instructions: Instructions
    parser: type[FrameParser]
    as_status: Callable[[Frame], StatusPacket | None]
    status_length: Callable[[int], int]
    trailer: Callable[[bytes | bytearray], bytes]
    identification: Identification
    group_read: Callable[[Blocks, bool], GroupRead]
    lines: Callable[[Blocks], Iterable[Blocks]]
    dialect: str
    reboot: Callable[[int], bytes] | None = None
    stuffed: bytes = b""
    fast_reads: bool = False
    mirrors: bool = False
    choice: tuple[str, int] | None = None
    eeprom_lock: str = ""
    answers_all: int = 2
    mute_model: str = ""
