"""A sync write that a loop fills with new values and sends again in each tick: what stays the same is made once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.bus.protocol import PROTOCOLS, Protocol
from hardware.families.dynamixel2.frames import HEADER, STUFFED_PATTERN


class SyncWrite:
    """The same register of n servos of one protocol.

    Attributes:
        values: what each gets, shape (n,), in counts; written into before `frame`.
    """

    def __init__(self, ids: Sequence[int], address: int, length: int, protocol: Protocol = PROTOCOLS[2]) -> None:
        """All values are 0 at first.

        Args:
            length: of the register, 1, 2 or 4 bytes, signed.
        """
        self._address, self._length, self._protocol = address, length, protocol
        self._trailer, self._stuffed = protocol.trailer, protocol.stuffed
        empty = b"".join(bytes((id,)) + bytes(length) for id in ids)
        whole = protocol.instructions.sync_write(address, length, empty)
        self._body = bytearray(whole[: -len(protocol.trailer(whole))])
        self._head = len(self._body) - len(empty)
        entries = np.frombuffer(self._body, dtype=[("id", "u1"), ("value", f"<i{length}")], offset=self._head)
        self.values: NDArray[Any] = entries["value"]

    def frame(self) -> bytes:
        """The bytes of the frame with the present values."""
        body = self._body
        if self._stuffed and body.find(STUFFED_PATTERN, len(HEADER)) >= 0:
            return self._protocol.instructions.sync_write(self._address, self._length, bytes(body[self._head :]))
        return b"".join((body, self._trailer(body)))
