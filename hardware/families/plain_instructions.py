"""The instructions of Protocol 1.0 and of Feetech STS servos, each as the bytes of one frame of `plain_frames`."""

from collections.abc import Iterable

from hardware.families.frames import BROADCAST
from hardware.families.plain_frames import build

PING = 0x01
READ = 0x02
WRITE = 0x03
REG_WRITE = 0x04
ACTION = 0x05
FACTORY_RESET = 0x06
REBOOT = 0x08  # MX alone
SYNC_READ = 0x82  # Feetech alone
SYNC_WRITE = 0x83
BULK_READ = 0x92  # MX alone


def ping(id: int) -> bytes:
    """Answered without parameters: model and firmware are in the control table."""
    return build(id, PING)


def read(id: int, address: int, length: int) -> bytes:
    """Asks one servo for `length` bytes of its control table."""
    return build(id, READ, bytes((address, length)))


def write(id: int, address: int, data: bytes) -> bytes:
    """Writes bytes into a servo's control table."""
    return build(id, WRITE, bytes((address,)) + data)


def sync_write(address: int, length: int, entries: bytes) -> bytes:
    """Writes the same registers of many servos at once, unanswered; entries are ID and `length` bytes, repeated."""
    return build(BROADCAST, SYNC_WRITE, bytes((address, length)) + entries)


def reboot(id: int) -> bytes:
    """Restarts a servo; only MX know it."""
    return build(id, REBOOT)


def sync_read(address: int, length: int, ids: Iterable[int]) -> bytes:
    """Asks many Feetech servos for the same registers; each answers with its own status, in this order."""
    return build(BROADCAST, SYNC_READ, bytes((address, length)) + bytes(ids))


def bulk_read(blocks: Iterable[tuple[int, int, int]]) -> bytes:
    """Asks each (id, address, length), MX servos only; each answers with its own status, in this order."""
    return build(BROADCAST, BULK_READ, b"\0" + b"".join(bytes((length, id, a)) for id, a, length in blocks))
