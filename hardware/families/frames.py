"""What the frames of all families have in common: ID, instruction or error, parameters; and the search for them."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import NamedTuple

import msgspec

BROADCAST = 0xFE  # the ID that means all servos
ERRORS = {
    1: "result fail",
    2: "instruction not possible",
    3: "bad checksum",
    4: "value out of range",
    5: "wrong data length",
    6: "value beyond a limit set in the servo",
    7: "register not accessible (read-only, undefined, or EEPROM while torque is on)",
}
"""What the error number of a status means; families with other errors say the same by these."""

PING, READ, WRITE, REG_WRITE, ACTION, FACTORY_RESET = range(1, 7)
REBOOT = 0x08
CLEAR = 0x10
BACKUP = 0x20
SYNC_READ = 0x82
SYNC_WRITE = 0x83
FAST_SYNC_READ = 0x8A
BULK_READ = 0x92
BULK_WRITE = 0x93
FAST_BULK_READ = 0x9A


class Frame(NamedTuple):
    """A frame with a good checksum, its body unstuffed."""

    id: int
    instruction: int
    params: bytes


class StatusPacket(msgspec.Struct, frozen=True, gc=False):
    """A servo's answer; a hot servo sets `alert`, which is no failure of the call."""

    id: int  # of the servo, 0 to 252
    error: int  # error number, 0 for none (see ERRORS)
    alert: bool  # whether the servo reports a hardware problem (register 70 holds which)
    params: bytes  # what was asked for
    # Which problems the servo has, where the answer itself tells (Protocol 1.0): 1 voltage, 4 heat, 32 overload.
    hardware: int = 0


@dataclass(frozen=True, slots=True)
class Instructions:
    """The instructions that every family has, each as the bytes of one frame."""

    build: Callable[[int, int, bytes], bytes]  # a frame with an ID, an instruction and its parameters
    words: Callable[..., bytes]  # addresses and lengths as parameters

    def ping(self, id: int) -> bytes:
        """Answered as the family's `Identification` says."""
        return self.build(id, PING, b"")

    def read(self, id: int, address: int, length: int) -> bytes:
        """Asks one servo for `length` bytes of its control table."""
        return self.build(id, READ, self.words(address, length))

    def write(self, id: int, address: int, data: bytes) -> bytes:
        """Writes bytes into a servo's control table."""
        return self.build(id, WRITE, self.words(address) + data)

    def reboot(self, id: int) -> bytes:
        """Restarts a servo, which brings it back from a shutdown; see `Series.reboots`."""
        return self.build(id, REBOOT, b"")

    def sync_write(self, address: int, length: int, entries: bytes) -> bytes:
        """Writes the same registers of many servos at once, unanswered; entries are ID and `length` bytes, repeated."""
        return self.build(BROADCAST, SYNC_WRITE, self.words(address, length) + entries)


class FrameParser:
    """Finds frames in bytes that arrive in pieces of any size; no input makes it raise.

    A frame with a bad checksum is dropped, and the next good one is found. How the bytes were cut into pieces makes no
    difference. The time is linear in their number: each header is looked at when it has arrived, and again when its
    frame must have ended. What is kept between calls never exceeds one frame.
    """

    _header: bytes
    _overhead: int  # bytes before what LENGTH counts
    _id: int  # where the ID stands in a frame

    __slots__ = ("_buffer", "_by_end", "_by_start", "_gone", "_searched", "_used", "corrupt", "damaged")

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._gone = 0  # bytes dropped in front of the buffer; every position counts from the first byte ever fed
        self._searched = 0  # headers that begin before this position are known
        self._used = 0  # the last good frame ended here: what began before was noise that looked like a header
        self._by_end: list[tuple[int, int]] = []  # a heap of (end, start) of the frames that have begun
        self._by_start: deque[tuple[int, int]] = deque()  # the same frames as (start, end)
        self.corrupt = 0  # how many frames were dropped because of their checksum or length, so far
        # The IDs of those that the last `feed` dropped, as far as an ID can be trusted in a damaged frame.
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
        kept = self._by_start[0][0] if self._by_start else self._searched
        del self._buffer[: kept - self._gone]
        self._gone = kept
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
        raise NotImplementedError

    def _frame_in(self, data: bytes) -> Frame | None:
        """The frame that these bytes are, None if its checksum is bad."""
        raise NotImplementedError

    def _drop(self, start: int) -> None:
        self.corrupt += 1
        self.damaged.append(self._buffer[start - self._gone + self._id])
