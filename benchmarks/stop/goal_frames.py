"""Goal positions in the bytes of a bus, read as the maker describes them and by no code of the project.

Protocol 2.0 (https://emanual.robotis.com/docs/en/dxl/protocol2/):

    FF FF FD 00 | ID | LENGTH (2) | INSTRUCTION | PARAMETERS ... | CRC (2)

LENGTH counts instruction, parameters and CRC. FF FF FD inside them is sent as FF FF FD FD. The CRC is CRC-16 with the
polynomial 8005, over everything before it.
"""

from __future__ import annotations

from collections.abc import Iterator

_HEADER = b"\xff\xff\xfd\x00"
WRITE, _SYNC_WRITE, _BULK_WRITE = 0x03, 0x83, 0x93

GOAL_POSITION = {"XM430-W350": 116}
"""Address of the goal position (4 bytes, signed), from the control table of each model on the maker's page,
https://emanual.robotis.com/docs/en/dxl/x/xm430-w350/."""

PULSES_PER_TURN = {"XM430-W350": 4096}
"""From the same pages."""


def crc(data: bytes) -> int:
    """CRC-16, polynomial 8005, start 0, highest bit first."""
    value = 0
    for byte in data:
        value = (value << 8 & 0xFFFF) ^ _TABLE[value >> 8 ^ byte]
    return value


def _remainder(byte: int) -> int:
    value = byte << 8
    for _ in range(8):
        value = (value << 1) ^ (0x8005 if value & 0x8000 else 0)
        value &= 0xFFFF
    return value


_TABLE = [_remainder(byte) for byte in range(256)]


class FrameReader:
    """Finds the frames in a stream of bytes that comes in pieces of any length.

    Attributes:
        damaged: how many had a wrong CRC.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._waiting = b""

    def feed(self, data: bytes) -> Iterator[tuple[int, int, bytes]]:
        """ID, instruction and parameters of each frame that is complete now."""
        self._waiting += data
        while True:
            start = self._waiting.find(_HEADER)
            if start < 0:
                self._waiting = self._waiting[-3:]
                return
            self._waiting = self._waiting[start:]
            if len(self._waiting) < 7:
                return
            end = 7 + int.from_bytes(self._waiting[5:7], "little")
            if len(self._waiting) < end:
                return
            frame, rest = self._waiting[:end], self._waiting[end:]
            if end < 10 or crc(frame[:-2]) != int.from_bytes(frame[-2:], "little"):
                self.damaged += 1
                self._waiting = self._waiting[4:]
                continue
            self._waiting = rest
            body = frame[7:-2].replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")
            yield frame[4], body[0], body[1:]


def goals_in(id: int, instruction: int, params: bytes, address_of: dict[int, int]) -> dict[int, int]:
    """The goals (pulses) by ID that a frame gives to servos, of which `address_of` has the goal's address by ID."""
    writes: list[tuple[int, int, bytes]] = []
    if instruction == WRITE:
        writes.append((id, _word(params, 0), params[2:]))
    elif instruction == _SYNC_WRITE:
        address, length = _word(params, 0), _word(params, 2)
        for at in range(4, len(params) - length, length + 1):
            writes.append((params[at], address, params[at + 1 : at + 1 + length]))
    elif instruction == _BULK_WRITE:
        at = 0
        while at + 5 < len(params):
            address, length = _word(params, at + 1), _word(params, at + 3)
            writes.append((params[at], address, params[at + 5 : at + 5 + length]))
            at += 5 + length
    goals: dict[int, int] = {}
    for servo, address, data in writes:
        for one in address_of if servo == 0xFE else (servo,):
            start = address_of.get(one, 1 << 16) - address
            if 0 <= start <= len(data) - 4:
                goals[one] = int.from_bytes(data[start : start + 4], "little", signed=True)
    return goals


def _word(data: bytes, at: int) -> int:
    return int.from_bytes(data[at : at + 2], "little")
