"""A sync write that a loop fills with new values and sends again in each tick: what stays the same is made once."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.families.family import Family
from hardware.families.models import USUAL

_BEHIND_HEADER = 4  # bytes: the header itself may have a pattern that is stuffed


class SyncWrite:
    """The same register of n servos of one family."""

    def __init__(self, ids: Sequence[int], address: int, length: int, family: Family = USUAL) -> None:
        """All values are 0 at first; the register has 1, 2 or 4 bytes, signed."""
        self._address, self._length, self._family = address, length, family
        self._trailer, self._stuffed = family.trailer, family.stuffed
        empty = b"".join(bytes((id,)) + bytes(length) for id in ids)
        whole = family.instructions.sync_write(address, length, empty)
        self._body = bytearray(whole[: -len(family.trailer(whole))])
        self._head = len(self._body) - len(empty)
        entries = np.frombuffer(self._body, dtype=[("id", "u1"), ("value", f"<i{length}")], offset=self._head)
        # What each gets, shape (n,), in counts; written into before `frame`.
        self.values: NDArray[Any] = entries["value"]

    def frame(self) -> bytes:
        """The bytes of the frame with the present values."""
        body = self._body
        if self._stuffed and body.find(self._stuffed, _BEHIND_HEADER) >= 0:
            return self._family.instructions.sync_write(self._address, self._length, bytes(body[self._head :]))
        return b"".join((body, self._trailer(body)))
