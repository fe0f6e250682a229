"""The instructions of Feetech STS servos, each as the bytes of one frame."""

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
    "FACTORY_RESET",
    "PING",
    "READ",
    "REG_WRITE",
    "SYNC_READ",
    "SYNC_WRITE",
    "WRITE",
    "ping",
    "read",
    "sync_read",
    "sync_write",
    "write",
)

SYNC_READ = 0x82


def sync_read(address: int, length: int, ids: Iterable[int]) -> bytes:
    """Asks many servos for the same registers; each answers with its own status, in this order."""
    return build(BROADCAST, SYNC_READ, bytes((address, length)) + bytes(ids))
