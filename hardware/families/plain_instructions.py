"""The instructions that all families with `plain_frames` have, each as the bytes of one frame."""

from __future__ import annotations

from hardware.families.frames import BROADCAST
from hardware.families.plain_frames import build

PING = 0x01
READ = 0x02
WRITE = 0x03
REG_WRITE = 0x04
ACTION = 0x05
FACTORY_RESET = 0x06
SYNC_WRITE = 0x83


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
