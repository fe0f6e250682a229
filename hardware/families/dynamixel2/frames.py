"""Frames of Protocol 2.0: built, found in any stream of bytes, and one an instruction.

    FF FF FD 00 | ID | LENGTH (2) | INSTRUCTION | PARAMETERS ... | CRC (2)        numbers little-endian

LENGTH counts what follows it. A status is a frame with instruction 55 whose first parameter is the error byte: bit 7
is set while the servo has a hardware problem (alert), the lower bits hold an error number. Only the joint reply to a
fast read (ID FE, instruction 55) is not stuffed.
"""

from collections.abc import Iterable

from fastcrc import crc16

from hardware.families import frames as common
from hardware.families.frames import BROADCAST, Frame, FrameParser, Instructions, StatusPacket

checksum = crc16.umts
"""checksum(data, start) is the CRC-16 (polynomial 0x8005, start 0, not reflected) of bytes, carried on from `start`.

checksum(a + b) == checksum(b, checksum(a)). It is the library's own function, since one more call costs a loop that has
slept as much as the CRC of a whole reply.
"""

HEADER = b"\xff\xff\xfd\x00"
STATUS = 0x55
ALERT = 0x80

STUFFED_PATTERN = b"\xff\xff\xfd"
_STUFFED = b"\xff\xff\xfd\xfd"

LONGEST = 8192  # no frame of a full bus (253 servos, 10 bytes each) comes near this; what claims more is noise

_SHORTEST = 3  # instruction and checksum
_OVERHEAD = 7  # header, ID and length stand before what LENGTH counts


def stuff(body: bytes) -> bytes:
    """The body as it goes onto the wire: FF FF FD becomes FF FF FD FD, so that a header always means a new frame."""
    # The pattern cannot overlap itself, and a stuffed FD follows an FD, so it never completes another pattern: one pass
    # from left to right is the same as scanning the output, and `unstuff` is the exact inverse for any bytes.
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


class Parser(FrameParser):
    """Finds frames of Protocol 2.0."""

    _header = HEADER
    _overhead = _OVERHEAD
    _id = 4

    __slots__ = ()

    def _length(self, at: int) -> int:
        length = self._buffer[at + 5] | self._buffer[at + 6] << 8
        if _SHORTEST <= length <= LONGEST:
            return length
        self._drop(self._gone + at)
        return 0

    def _frame_in(self, data: bytes) -> Frame | None:
        if checksum(data[:-2]) != data[-2] | data[-1] << 8:
            return None
        id, instruction = data[4], data[_OVERHEAD]
        body = data[_OVERHEAD:-2]
        fast_reply = id == BROADCAST and instruction == STATUS
        return Frame(id, instruction, (body if fast_reply else unstuff(body))[1:])


CLEAR_TURNS = b"\x01\x44\x58\x4c\x22"
BACKUP_STORE = b"\x01\x43\x54\x52\x4c"
BACKUP_RESTORE = b"\x02\x43\x54\x52\x4c"


def words(*values: int) -> bytes:
    """16-bit numbers, little-endian."""
    return b"".join(value.to_bytes(2, "little") for value in values)


INSTRUCTIONS = Instructions(build, words)
ping, read, write = INSTRUCTIONS.ping, INSTRUCTIONS.read, INSTRUCTIONS.write
reboot, sync_write = INSTRUCTIONS.reboot, INSTRUCTIONS.sync_write


def sync_read(address: int, length: int, ids: Iterable[int], fast: bool = False) -> bytes:
    """Asks many servos for the same registers; each answers with its own status, in this order.

    If `fast` they do so in one frame: see `group_reply.fast_reply`.
    """
    return build(BROADCAST, common.FAST_SYNC_READ if fast else common.SYNC_READ, words(address, length) + bytes(ids))


def bulk_read(blocks: Iterable[tuple[int, int, int]], fast: bool = False) -> bytes:
    """Asks each (id, address, length) for its own registers; they answer as to `sync_read`."""
    asked = b"".join(bytes((id,)) + words(address, length) for id, address, length in blocks)
    return build(BROADCAST, common.FAST_BULK_READ if fast else common.BULK_READ, asked)
