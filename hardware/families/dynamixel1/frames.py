"""Frames of Protocol 1.0: building them, and finding them in a stream of bytes.

    FF FF | ID | LENGTH | INSTRUCTION or ERROR | PARAMETERS ... | CHECKSUM

LENGTH counts what follows it; CHECKSUM is the inverted sum of everything from ID on. Nothing is stuffed, and a status
looks like an instruction: only the sender tells them apart. ERROR is a set of bits, of which three are about the servo
itself, as in its hardware error status under Protocol 2.0, and four about the instruction.
"""

from __future__ import annotations

from hardware.families.frames import BROADCAST, Frame, FrameParser, StatusPacket

HEADER = b"\xff\xff"
LONGEST = 250  # what LENGTH may say; the maker's own SDK takes no more
_SHORTEST = 2
_BEFORE = 4  # bytes before what LENGTH counts

VOLTAGE, HEAT, OVERLOAD = 1, 4, 32
_HARDWARE = VOLTAGE | HEAT | OVERLOAD
ANGLE_LIMIT, OUT_OF_RANGE, BAD_CHECKSUM, BAD_INSTRUCTION = 2, 8, 16, 64
ERROR_NUMBERS = {BAD_INSTRUCTION: 2, BAD_CHECKSUM: 3, OUT_OF_RANGE: 4, ANGLE_LIMIT: 6}
"""The error number that Protocol 2.0 has for the same."""


def build(id: int, instruction: int, params: bytes = b"") -> bytes:
    """The bytes of one frame; for an answer, `instruction` is the error byte. ValueError for an ID or length beyond."""
    if not 0 <= id <= BROADCAST:
        raise ValueError(f"{id} is no Dynamixel id of Protocol 1.0: 0 to 253, or 254 for all")
    length = len(params) + 2
    if length > LONGEST:
        raise ValueError(f"a frame of {length} bytes is too long: at most {LONGEST}")
    frame = HEADER + bytes((id, length, instruction)) + params
    return frame + trailer(frame)


def trailer(frame: bytes | bytearray) -> bytes:
    """The checksum byte behind a frame without it."""
    return bytes((~sum(frame[len(HEADER) :]) & 0xFF,))


def status_length(length: int) -> int:
    """How many bytes an answer with `length` parameters has."""
    return _BEFORE + 2 + length


def as_status(frame: Frame) -> StatusPacket | None:
    """The answer that a frame carries; None where the sender cannot be a servo."""
    if frame.id >= BROADCAST:
        return None
    error = next((number for bit, number in ERROR_NUMBERS.items() if frame.instruction & bit), 0)
    hardware = frame.instruction & _HARDWARE
    return StatusPacket(frame.id, error, bool(hardware), frame.params, hardware)


class Parser1(FrameParser):
    """Finds frames of Protocol 1.0."""

    _header = HEADER
    _overhead = _BEFORE
    _id = 2

    __slots__ = ()

    def _length(self, at: int) -> int:
        id, length = self._buffer[at + 2], self._buffer[at + 3]
        # Three FF are noise before a header, which begins with the second or the third.
        return length if id <= BROADCAST and _SHORTEST <= length <= LONGEST else 0

    def _frame_in(self, data: bytes) -> Frame | None:
        if ~sum(data[2:-1]) & 0xFF != data[-1]:
            return None
        return Frame(data[2], data[4], data[5:-1])
