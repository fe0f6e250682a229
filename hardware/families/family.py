"""A servo family as a value: its frames, group reads, identity and locks. The bus and the rig work on this alone."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from hardware.families.frames import Frame, FrameParser, Instructions, StatusPacket
from hardware.families.replies import Blocks, GroupRead


@dataclass(frozen=True, slots=True)
class Identification:
    """Where a servo tells what it is: in its answer to a ping, or in its first registers."""

    number: int  # where the model number (2 bytes) stands
    firmware: int  # where the firmware version stands
    length: int  # bytes of an answer to a ping with these, or how many registers to read from address 0 on
    by_ping: bool  # whether the answer to a ping has them
    id: int | None = None  # where its own ID stands, which distinguishes families with the same frames; None without

    def read(self, data: bytes) -> tuple[int, int]:
        """Model number and firmware version."""
        return data[self.number] | data[self.number + 1] << 8, data[self.firmware]


@dataclass(frozen=True, slots=True, eq=False)
class Family:
    """A servo family."""

    name: str  # of its folder
    spoken: str  # an addition to a sentence about one of its servos, "" for the usual family
    instructions: Instructions  # builds its frames
    parser: type[FrameParser]  # finds frames in received bytes
    as_status: Callable[[Frame], StatusPacket | None]  # the status that a frame carries, or None
    status_length: Callable[[int], int]  # bytes of a status with some parameter bytes
    trailer: Callable[[bytes | bytearray], bytes]  # the checksum of a frame without it
    identification: Identification  # where a servo tells its model
    # Reads (id, address, length) of each of several servos in one request, in one joint reply if asked.
    group_read: Callable[[Blocks, bool], GroupRead]
    # Divides blocks into the parts that one group read can be about, whatever their models.
    lines: Callable[[Blocks], Iterable[Blocks]]
    dialect: str  # the same for families whose pings and answers look alike
    # The instruction that restarts a servo of a series that can be, or None.
    reboot: Callable[[int], bytes] | None = None
    stuffed: bytes = b""  # a pattern that a frame's body must not have as it is; b"" for none
    fast_reads: bool = False  # whether some of its models answer group reads jointly
    mirrors: bool = False  # whether an instruction looks like an answer, so that an adapter's echo does too
    # Register and value by which a servo that knows several families is set to this one, or None.
    choice: tuple[str, int] | None = None
    eeprom_lock: str = ""  # the register that is 0 while EEPROM keeps what is written; "" where torque locks it
    answers_all: int = 2  # the status return level at which every instruction is answered
    # A model in which torque and status return level stand where they do in all that may be mute, or "".
    mute_model: str = ""
