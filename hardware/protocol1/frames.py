"""Frames of Protocol 1.0: building them, and finding them in a stream of bytes.

    FF FF | ID | LENGTH | INSTRUCTION or ERROR | PARAMETERS ... | CHECKSUM

LENGTH counts what follows it; CHECKSUM is the inverted sum of everything from ID on. Nothing is stuffed, and the answer
of a servo looks like an instruction: only who has sent it tells them apart. ERROR is a set of bits, of which three are
about the servo itself, as in its hardware error status under Protocol 2.0, and four about the instruction.
"""

from __future__ import annotations

from hardware.protocol2.frames import BROADCAST, Frame, StatusPacket

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
    """The bytes of one frame; for an answer, `instruction` is the error byte.

    Raises:
        ValueError: if the ID is none (0 to 253, 254), or the frame would be too long.
    """
    if not 0 <= id <= BROADCAST:
        raise ValueError(f"{id} is no Dynamixel id of Protocol 1.0: 0 to 253, or 254 for all")
    length = len(params) + 2
    if length > LONGEST:
        raise ValueError(f"a frame of {length} bytes is too long: at most {LONGEST}")
    body = bytes((id, length, instruction)) + params
    return HEADER + body + bytes((~sum(body) & 0xFF,))


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


class OldParser:
    """Finds frames in bytes that arrive in pieces of any size; no input makes it raise.

    A frame with a bad checksum is dropped, and the next good one is found. What is kept never exceeds one frame.

    Attributes:
        damaged: the IDs of the frames that the last `feed` dropped, as far as an ID in a damaged frame can be trusted.
    """

    __slots__ = ("_buffer", "damaged")

    def __init__(self) -> None:
        self._buffer = b""
        self.damaged: list[int] = []

    @property
    def waiting(self) -> bool:
        """Whether a frame has begun and its end has not arrived."""
        return bool(self._buffer)

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that these bytes complete, in order."""
        self.damaged = []
        buffer = self._buffer + data
        frames: list[Frame] = []
        used = 0  # the last good frame ended here
        kept: int | None = None  # where the first frame begins whose end is still to come
        start = buffer.find(HEADER)
        while start >= 0:
            following = start + 1
            known = buffer[start + 2 : start + _BEFORE]
            end = start + _BEFORE + (known[1] if len(known) == 2 else _SHORTEST)
            if known[:1] == b"\xff" or (len(known) == 2 and not _SHORTEST <= known[1] <= LONGEST):
                pass  # the header begins later, or this is none
            elif end > len(buffer):
                kept = start if kept is None else kept
            elif ~sum(buffer[start + 2 : end - 1]) & 0xFF != buffer[end - 1]:
                self.damaged.append(buffer[start + 2])
            else:
                frames.append(Frame(buffer[start + 2], buffer[start + 4], buffer[start + 5 : end - 1]))
                kept, following, used = None, end, end
            start = buffer.find(HEADER, following)
        half_header = buffer.endswith(b"\xff") and used < len(buffer)
        self._buffer = buffer[len(buffer) - half_header if kept is None else kept :]
        return frames
