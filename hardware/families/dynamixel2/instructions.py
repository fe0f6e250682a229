"""The instructions of Protocol 2.0, each as the bytes of one frame."""

from collections.abc import Iterable

from hardware.families.dynamixel2.frames import build
from hardware.families.frames import BROADCAST

PING = 0x01
READ = 0x02
WRITE = 0x03
REG_WRITE = 0x04
ACTION = 0x05
FACTORY_RESET = 0x06
REBOOT = 0x08
CLEAR = 0x10
BACKUP = 0x20
SYNC_READ = 0x82
SYNC_WRITE = 0x83
FAST_SYNC_READ = 0x8A
BULK_READ = 0x92
BULK_WRITE = 0x93
FAST_BULK_READ = 0x9A

CLEAR_TURNS = b"\x01\x44\x58\x4c\x22"
BACKUP_STORE = b"\x01\x43\x54\x52\x4c"
BACKUP_RESTORE = b"\x02\x43\x54\x52\x4c"


def words(*values: int) -> bytes:
    """16-bit numbers, little-endian."""
    return b"".join(value.to_bytes(2, "little") for value in values)


def ping(id: int) -> bytes:
    """Answered with model number (2 bytes) and firmware version."""
    return build(id, PING)


def read(id: int, address: int, length: int) -> bytes:
    """Asks one servo for `length` bytes of its control table."""
    return build(id, READ, words(address, length))


def write(id: int, address: int, data: bytes) -> bytes:
    """Writes bytes into a servo's control table."""
    return build(id, WRITE, words(address) + data)


def reboot(id: int) -> bytes:
    """Restarts a servo: the only way to bring it back from a shutdown."""
    return build(id, REBOOT)


def sync_read(address: int, length: int, ids: Iterable[int]) -> bytes:
    """Asks many servos for the same registers; each answers with its own status, in this order."""
    return build(BROADCAST, SYNC_READ, words(address, length) + bytes(ids))


def fast_sync_read(address: int, length: int, ids: Iterable[int]) -> bytes:
    """As `sync_read`, but all answer in one frame: see `group_reply.fast_reply`."""
    return build(BROADCAST, FAST_SYNC_READ, words(address, length) + bytes(ids))


def sync_write(address: int, length: int, entries: bytes) -> bytes:
    """Writes the same registers of many servos at once, unanswered; entries are ID and `length` bytes, repeated."""
    return build(BROADCAST, SYNC_WRITE, words(address, length) + entries)


def bulk_read(blocks: Iterable[tuple[int, int, int]]) -> bytes:
    """Asks each (id, address, length) for its own registers; each answers with its own status, in this order."""
    return build(BROADCAST, BULK_READ, b"".join(bytes((id,)) + words(a, length) for id, a, length in blocks))


def fast_bulk_read(blocks: Iterable[tuple[int, int, int]]) -> bytes:
    """As `bulk_read`, but all answer in one frame: see `group_reply.fast_reply`."""
    return build(BROADCAST, FAST_BULK_READ, b"".join(bytes((id,)) + words(a, length) for id, a, length in blocks))
