"""The checksum of Protocol 2.0: CRC-16, polynomial 0x8005, start 0, nothing reflected (known as UMTS or BUYPASS)."""

from __future__ import annotations

from fastcrc import crc16


def checksum(data: bytes | bytearray, start: int = 0) -> int:
    """The CRC of `data`, carried on from `start`: checksum(a + b) == checksum(b, checksum(a))."""
    return crc16.umts(data, start)
