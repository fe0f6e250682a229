"""The instructions of Protocol 1.0, each as the bytes of one frame."""

from __future__ import annotations

from collections.abc import Iterable

from hardware.families.frames import BROADCAST
from hardware.families.plain_frames import build
from hardware.families.plain_instructions import (
    ACTION,
    FACTORY_RESET,
    PING,
    READ,
    REG_WRITE,
    SYNC_WRITE,
    WRITE,
    ping,
    read,
    sync_write,
    write,
)

__all__ = (
    "ACTION",
    "BULK_READ",
    "FACTORY_RESET",
    "PING",
    "READ",
    "REBOOT",
    "REG_WRITE",
    "SYNC_WRITE",
    "WRITE",
    "bulk_read",
    "ping",
    "read",
    "reboot",
    "sync_write",
    "write",
)

REBOOT = 0x08
BULK_READ = 0x92


def reboot(id: int) -> bytes:
    """Restarts a servo; only MX know it."""
    return build(id, REBOOT)


def bulk_read(blocks: Iterable[tuple[int, int, int]]) -> bytes:
    """Asks each (id, address, length), MX servos only; each answers with its own status, in this order."""
    return build(BROADCAST, BULK_READ, b"\0" + b"".join(bytes((length, id, a)) for id, a, length in blocks))
