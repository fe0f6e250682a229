"""Frames of Protocol 2.0: building them, and finding them again in any stream of bytes.

    FF FF FD 00 | ID | LENGTH (2) | INSTRUCTION | PARAMETERS ... | CRC (2)        numbers little-endian

LENGTH counts what follows it. A status is a frame with instruction 55 whose first parameter is the error byte: bit 7
is set while the servo has a hardware problem (alert), the lower bits hold an error number. Only the joint reply to a
fast read (ID FE, instruction 55) is not stuffed.
"""

from __future__ import annotations

from collections import deque
from heapq import heappop, heappush
from typing import NamedTuple

import msgspec
from fastcrc import crc16

checksum = crc16.umts
"""checksum(data, start) is the CRC-16 (polynomial 0x8005, start 0, not reflected) of bytes, carried on from `start`.

checksum(a + b) == checksum(b, checksum(a)). It is the library's own function, since one more call costs a loop that has
slept as much as the CRC of a whole reply.
"""

HEADER = b"\xff\xff\xfd\x00"
BROADCAST = 0xFE
STATUS = 0x55
ALERT = 0x80

STUFFED_PATTERN = b"\xff\xff\xfd"
_STUFFED = b"\xff\xff\xfd\xfd"

# No frame of a full bus (253 servos, 10 bytes each) comes near this; what claims more is noise.
LONGEST = 8192

_SHORTEST = 3  # instruction and checksum
_OVERHEAD = 7  # header, ID and length stand before what LENGTH counts


class Frame(NamedTuple):
    """A frame with a good checksum, its body unstuffed."""

    id: int
    instruction: int
    params: bytes


class StatusPacket(msgspec.Struct, frozen=True, gc=False):
    """A servo's answer; a hot servo sets `alert`, which is no failure of the call.

    Attributes:
        id: of the servo, 0 to 252.
        error: error number, 0 for none (see `instructions.ERRORS`).
        alert: whether the servo reports a hardware problem (register 70 holds which).
        params: what was asked for.
        hardware: which problems the servo has, where the answer itself tells (Protocol 1.0): 1 voltage, 4 heat, 32
            overload.
    """

    id: int
    error: int
    alert: bool
    params: bytes
    hardware: int = 0


def stuff(body: bytes) -> bytes:
    """The body as it goes onto the wire: FF FF FD becomes FF FF FD FD, so that a header always means a new frame.

    The pattern cannot overlap itself, and a stuffed FD follows an FD, so it never completes another pattern: one pass
    from left to right is the same as scanning the output, and `unstuff` is the exact inverse for any bytes.
    """
    return body.replace(STUFFED_PATTERN, _STUFFED)


def unstuff(body: bytes) -> bytes:
    """The body as it was before `stuff`."""
    return body.replace(_STUFFED, STUFFED_PATTERN)


def trailer(frame: bytes | bytearray) -> bytes:
    """The CRC bytes behind a frame without them."""
    return checksum(frame).to_bytes(2, "little")


def build(id: int, instruction: int, params: bytes = b"") -> bytes:
    """The bytes of one frame; raises ValueError for an ID or a length beyond the protocol's."""
    if not (0 <= id <= 252 or id == BROADCAST):
        raise ValueError(f"{id} is no Dynamixel id: 0 to 252, or 254 for all")
    body = stuff(bytes((instruction,)) + params)
    length = len(body) + 2
    if length > LONGEST:
        raise ValueError(f"a frame of {length} bytes is too long: at most {LONGEST}")
    frame = HEADER + bytes((id, length & 0xFF, length >> 8)) + body
    return frame + trailer(frame)


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
    """Finds frames in bytes that arrive in pieces of any size; no input makes it raise.

    A frame with a bad checksum is dropped, and the next good one is found. How the bytes were cut into pieces makes no
    difference. The time is linear in their number: each header is looked at when it has arrived, and again when its
    frame must have ended. What is kept between calls never exceeds one frame.

    Attributes:
        corrupt: how many frames were dropped because of their checksum or length, so far.
        damaged: the IDs of those that the last `feed` dropped, as far as an ID can be trusted in a damaged frame.
    """

    _header = HEADER
    _overhead = _OVERHEAD
    _id = 4  # where the ID stands in a frame

    __slots__ = ("_buffer", "_by_end", "_by_start", "_gone", "_searched", "_used", "corrupt", "damaged")

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._gone = 0  # bytes dropped in front of the buffer; every position counts from the first byte ever fed
        self._searched = 0  # headers that begin before this position are known
        self._used = 0  # the last good frame ended here: what began before was noise that looked like a header
        self._by_end: list[tuple[int, int]] = []  # a heap of (end, start) of the frames that have begun
        self._by_start: deque[tuple[int, int]] = deque()  # the same frames as (start, end)
        self.corrupt = 0
        self.damaged: list[int] = []

    @property
    def waiting(self) -> bool:
        """Whether a frame has begun and its end has not arrived."""
        return bool(self._by_start) or self._buffer.startswith(self._header)

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that these bytes complete, in order."""
        self.damaged = []
        self._buffer += data
        self._find_headers()
        arrived = self._gone + len(self._buffer)
        frames: list[Frame] = []
        while self._by_end and self._by_end[0][0] <= arrived:
            end, start = heappop(self._by_end)
            if start < self._used:
                continue
            frame = self._frame_in(bytes(self._buffer[start - self._gone : end - self._gone]))
            if frame is None:
                self._drop(start)
            else:
                frames.append(frame)
                self._used = end
        while self._by_start and (self._by_start[0][0] < self._used or self._by_start[0][1] <= arrived):
            self._by_start.popleft()
        self._forget(self._by_start[0][0] if self._by_start else self._searched)
        return frames

    def _find_headers(self) -> None:
        buffer, header, overhead = self._buffer, self._header, self._overhead
        at = buffer.find(header, self._searched - self._gone)
        while at >= 0 and at + overhead <= len(buffer):
            start, length = self._gone + at, self._length(at)
            if length:
                end = start + overhead + length
                heappush(self._by_end, (end, start))
                self._by_start.append((start, end))
            self._searched = start + 1
            at = buffer.find(header, at + 1)
        # Where no header is left, the last bytes may still be the beginning of one.
        rest = at if at >= 0 else len(buffer) - len(header) + 1
        self._searched = max(self._searched, self._gone + rest)

    def _length(self, at: int) -> int:
        """The LENGTH of the frame whose header is here in the buffer; 0 where it can be none."""
        length = self._buffer[at + 5] | self._buffer[at + 6] << 8
        if _SHORTEST <= length <= LONGEST:
            return length
        self._drop(self._gone + at)
        return 0

    def _frame_in(self, data: bytes) -> Frame | None:
        """The frame that these bytes are, None if its checksum is bad."""
        if checksum(data[:-2]) != data[-2] | data[-1] << 8:
            return None
        id, instruction = data[4], data[_OVERHEAD]
        body = data[_OVERHEAD:-2]
        fast_reply = id == BROADCAST and instruction == STATUS
        return Frame(id, instruction, (body if fast_reply else unstuff(body))[1:])

    def _drop(self, start: int) -> None:
        self.corrupt += 1
        self.damaged.append(self._buffer[start - self._gone + self._id])

    def _forget(self, before: int) -> None:
        del self._buffer[: before - self._gone]
        self._gone = before
