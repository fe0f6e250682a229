"""A sync write that a loop fills with new values and sends again in each tick: what stays the same is made once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.protocol1 import instructions as old_words
from hardware.protocol2 import instructions
from hardware.protocol2.crc import checksum
from hardware.protocol2.frames import HEADER

_HEAD = 12  # what stands before the first entry: header, BROADCAST, length, instruction, address, size
_PATTERN = HEADER[:3]


class SyncWrite:
    """The same register of n servos of one protocol.

    Attributes:
        values: what each gets, shape (n,), in counts; written into before `frame`.
    """

    def __init__(self, ids: Sequence[int], address: int, length: int, old: bool = False) -> None:
        """All values are 0 at first.

        Args:
            ids: of the servos.
            address: of the register.
            length: of the register, 1, 2 or 4 bytes, signed.
            old: whether they speak Protocol 1.0.
        """
        self._address, self._length, self._old = address, length, old
        empty = b"".join(bytes((id,)) + bytes(length) for id in ids)
        self._body = bytearray(instructions.sync_write(address, length, empty)[:-2])
        entries = np.frombuffer(self._body, dtype=[("id", "u1"), ("value", f"<i{length}")], offset=_HEAD)
        self.values: NDArray[Any] = entries["value"]

    def frame(self) -> bytes:
        """The bytes of the frame with the present values."""
        body = self._body
        if self._old:
            return old_words.sync_write(self._address, self._length, bytes(body[_HEAD:]))
        if body.find(_PATTERN, len(HEADER)) >= 0:
            return instructions.sync_write(self._address, self._length, bytes(body[_HEAD:]))
        return b"".join((body, checksum(body).to_bytes(2, "little")))
