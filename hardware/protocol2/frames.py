"""Frames of Protocol 2.0: building them, and finding them again in any stream of bytes.

    FF FF FD 00 | ID | LENGTH (2) | INSTRUCTION | PARAMETERS ... | CRC (2)        numbers little-endian

LENGTH counts what follows it. A status is a frame with instruction 55 whose first parameter is the error byte: bit 7
says that the servo has a hardware problem (alert), the lower bits hold an error number. Only the joint reply to a fast
read (ID FE, instruction 55) is not stuffed.
"""

from __future__ import annotations

from typing import NamedTuple

from hardware.protocol2.crc import checksum
from hardware.protocol2.stuffing import stuff, unstuff

HEADER = b"\xff\xff\xfd\x00"
BROADCAST = 0xFE
STATUS = 0x55
ALERT = 0x80

# No frame of a full bus (253 servos, 10 bytes each) comes near this; what claims more is noise.
LONGEST = 8192

_OVERHEAD = 7  # header, ID and length stand before what LENGTH counts


class Frame(NamedTuple):
    """A frame with a good checksum, its body unstuffed."""

    id: int
    instruction: int
    params: bytes


class StatusPacket(NamedTuple):
    """A servo's answer; a hot servo sets `alert`, which is no failure of the call.

    Attributes:
        id: of the servo, 0 to 252.
        error: error number, 0 for none (see `instructions.ERRORS`).
        alert: whether the servo reports a hardware problem (register 70 says which).
        params: what was asked for.
    """

    id: int
    error: int
    alert: bool
    params: bytes


def build(id: int, instruction: int, params: bytes = b"") -> bytes:
    """The bytes of one frame.

    Raises:
        ValueError: if the ID is none (0 to 252, 254), or the frame would be longer than LONGEST.
    """
    if not (0 <= id <= 252 or id == BROADCAST):
        raise ValueError(f"{id} is no Dynamixel id: 0 to 252, or 254 for all")
    body = stuff(bytes((instruction,)) + params)
    length = len(body) + 2
    if length > LONGEST:
        raise ValueError(f"a frame of {length} bytes is too long: at most {LONGEST}")
    frame = HEADER + bytes((id, length & 0xFF, length >> 8)) + body
    return frame + checksum(frame).to_bytes(2, "little")


def build_status(id: int, error: int = 0, params: bytes = b"", alert: bool = False) -> bytes:
    """The bytes of a servo's answer."""
    return build(id, STATUS, bytes((error | ALERT if alert else error,)) + params)


def as_status(frame: Frame) -> StatusPacket | None:
    """The status that a frame carries; None where it is an instruction, a fast reply, or lacks its error byte."""
    if frame.instruction != STATUS or frame.id == BROADCAST or not frame.params:
        return None
    error = frame.params[0]
    return StatusPacket(frame.id, error & ~ALERT, bool(error & ALERT), frame.params[1:])


class Parser:
    """Finds frames in bytes that arrive in pieces of any size; nothing that arrives makes it raise.

    A frame with a bad checksum, or one cut short by the next, is dropped, and the next good one is found. What is kept
    between calls never exceeds one frame.

    Attributes:
        corrupt: how many frames were dropped because of their checksum, so far.
        damaged: the IDs of those that the last `feed` dropped, as far as an ID can be trusted in a damaged frame.
    """

    __slots__ = ("_buffer", "corrupt", "damaged")

    def __init__(self) -> None:
        self._buffer = b""
        self.corrupt = 0
        self.damaged: list[int] = []

    @property
    def waiting(self) -> bool:
        """Whether a frame has begun and its end has not arrived."""
        return self._buffer.startswith(HEADER)

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that these bytes complete, in order."""
        buffer = self._buffer + data
        frames: list[Frame] = []
        self.damaged = []
        done = 0  # everything before is used up
        waiting = None  # the first header whose frame has not arrived in full
        start = buffer.find(HEADER)
        while start >= 0:
            end = _end(buffer, start)
            frame = None if end is None else _frame_between(buffer, start, end)
            if frame is not None and end is not None:
                frames.append(frame)
                done, waiting = end, None
            elif end is not None:
                if waiting is None:
                    self.corrupt += 1
                    self.damaged.append(buffer[start + 4])
            elif waiting is None:
                # It may be noise that looks like a header, so a whole frame behind it still counts: inside a good frame
                # there can be none, stuffing sees to that.
                waiting = start
            start = buffer.find(HEADER, done if frame is not None else start + 1)
        self._buffer = buffer[max(done, len(buffer) - 3) if waiting is None else waiting :]
        return frames


def _end(buffer: bytes, start: int) -> int | None:
    """Where the frame that starts here ends; None while its end has not arrived, `start` if its length is nonsense."""
    if len(buffer) < start + _OVERHEAD:
        return None
    length = buffer[start + 5] | buffer[start + 6] << 8
    if not 3 <= length <= LONGEST:
        return start
    end = start + _OVERHEAD + length
    return end if end <= len(buffer) else None


def _frame_between(buffer: bytes, start: int, end: int) -> Frame | None:
    """The frame in buffer[start:end], None if its checksum is bad."""
    if end <= start or checksum(buffer[start : end - 2]) != buffer[end - 2] | buffer[end - 1] << 8:
        return None
    id, instruction = buffer[start + 4], buffer[start + _OVERHEAD]
    body = buffer[start + _OVERHEAD : end - 2]
    fast_reply = id == BROADCAST and instruction == STATUS
    return Frame(id, instruction, (body if fast_reply else unstuff(body))[1:])
