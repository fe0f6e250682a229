"""The checksum of Protocol 2.0: CRC-16, polynomial 0x8005, start 0, nothing reflected (known as UMTS or BUYPASS).

checksum(data, start) is the CRC of bytes, carried on from `start` (0): checksum(a + b) == checksum(b, checksum(a)). It
is the library's own function, since one more call costs a loop that has slept as much as the CRC of a whole reply.
"""

from __future__ import annotations

from fastcrc import crc16

checksum = crc16.umts
