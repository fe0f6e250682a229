"""Frames with one checksum byte, of Protocol 1.0 and Feetech STS: built, found in a stream, and one an instruction.

    FF FF | ID | LENGTH | INSTRUCTION or ERROR | PARAMETERS ... | CHECKSUM

LENGTH counts what follows it; CHECKSUM is the inverted sum of everything from ID on. Nothing is stuffed, and a status
looks like an instruction: only the sender tells them apart. What the bits of ERROR mean is the family's.
"""

from collections.abc import Iterable

from hardware.families.frames import BROADCAST, BULK_READ, SYNC_READ, Frame, FrameParser, Instructions

HEADER = b"\xff\xff"
LONGEST = 250  # what LENGTH may say; the makers' own SDKs take no more
_SHORTEST = 2
BEFORE = 4  # bytes before what LENGTH counts


def build(id: int, instruction: int, params: bytes = b"") -> bytes:
    """The bytes of one frame; for an answer, `instruction` is the error byte. ValueError for an ID or length beyond."""
    if not 0 <= id <= BROADCAST:
        raise ValueError(f"{id} is no id of a servo: 0 to 253, or 254 for all")
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
    return BEFORE + 2 + length


class PlainParser(FrameParser):
    """Finds frames with one checksum byte."""

    _header = HEADER
    _overhead = BEFORE
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


INSTRUCTIONS = Instructions(build, lambda *values: bytes(values))
ping, read, write = INSTRUCTIONS.ping, INSTRUCTIONS.read, INSTRUCTIONS.write
reboot, sync_write = INSTRUCTIONS.reboot, INSTRUCTIONS.sync_write


def sync_read(address: int, length: int, ids: Iterable[int]) -> bytes:
    """Asks many Feetech servos for the same registers; each answers with its own status, in this order."""
    return build(BROADCAST, SYNC_READ, bytes((address, length)) + bytes(ids))


def bulk_read(blocks: Iterable[tuple[int, int, int]]) -> bytes:
    """Asks each (id, address, length), MX servos only; each answers with its own status, in this order."""
    return build(BROADCAST, BULK_READ, b"\0" + b"".join(bytes((length, id, a)) for id, a, length in blocks))
