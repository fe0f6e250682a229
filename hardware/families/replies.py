"""Group reads and their replies, in whatever frames they come.

An undamaged reply in which every servo answered is taken in one pass, as rows of bytes of equal length (`WholeReply`);
any other is read servo by servo (`GroupReply`).
"""

from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache, partial
from itertools import repeat
from struct import Struct
from typing import NamedTuple

from hardware.families.frames import Frame, FrameParser, StatusPacket

Blocks = tuple[tuple[int, int, int], ...]  # (id, address, length): what to read of each servo


class GroupReply(NamedTuple):
    """The reply to a group read, servo by servo."""

    statuses: dict[int, StatusPacket]  # of the servos that were heard, by ID
    corrupt: list[int]  # IDs whose piece came with a bad checksum
    silent: list[int]  # IDs that sent nothing when it was their turn
    unheard: list[int]  # IDs behind the last silent one, which a servo that waits for its turn could not follow


class WholeReply(NamedTuple):
    """A reply in which every servo answered, undamaged and in the order asked."""

    rows: bytes  # one after another, `stride` bytes each
    stride: int  # bytes a servo
    error: int  # where the error byte stands in a row
    data: int  # where the registers stand in a row
    alert: int  # the bits of the error byte that report a problem of the servo; the others are an error number
    tail: int  # bytes of a row behind the registers

    def statuses(self, ids: Sequence[int] | bytes) -> dict[int, StatusPacket]:
        """The same as statuses by ID, in the order asked."""
        unpack, errorless, empty = _form(bytes(ids), self.data, self.stride, self.tail)
        errors, numbers, alerts = self.rows[self.error :: self.stride], repeat(0), repeat(False)
        if errors != errorless:
            alert = self.alert
            numbers, alerts = [error & ~alert for error in errors], [error & alert != 0 for error in errors]
        statuses = empty.copy()  # which is as large already as it gets
        statuses.update(zip(ids, map(StatusPacket, ids, numbers, alerts, unpack(self.rows)), strict=True))
        return statuses


whole_reply = partial(tuple.__new__, WholeReply)
"""WholeReply(*fields) as whole_reply(fields): the base of the named tuple's constructor, in a third of its time."""


@lru_cache(maxsize=64)
def _form(
    ids: bytes, data: int, stride: int, tail: int
) -> tuple[Callable[[bytes], tuple[bytes, ...]], bytes, dict[int, StatusPacket]]:
    """What unpacks the registers of rows and skips the bytes around them; error bytes without an error; the IDs."""
    rows = Struct("<" + f"{data}x{stride - tail - data}s{tail}x" * len(ids))
    return rows.unpack, bytes(len(ids)), dict.fromkeys(ids, StatusPacket(0, 0, False, b""))


def single_replies(ids: Sequence[int], lengths: Sequence[int], statuses: Iterable[StatusPacket]) -> GroupReply:
    """Sorts the single statuses that came from the servos `ids`, asked in this order for `lengths` bytes."""
    expected = dict(zip(ids, lengths, strict=True))
    heard = {
        status.id: status
        for status in statuses
        if status.id in expected and (status.error or len(status.params) == expected[status.id])
    }
    last = max((index for index, id in enumerate(ids) if id in heard), default=-1)
    # Silent are those with a servo behind them that was heard, and the first behind the last that was.
    silent = [id for id in ids[: last + 2] if id not in heard]
    return GroupReply(heard, [], silent, list(ids[last + 2 :]))


def in_order(
    parser: type[FrameParser],
    as_status: Callable[[Frame], StatusPacket | None],
    ids: Sequence[int],
    lengths: Sequence[int],
    received: bytes,
) -> tuple[GroupReply, bool]:
    """The statuses in received bytes, sorted; such a reply never shows its end."""
    statuses = (status for frame in parser().feed(received) if (status := as_status(frame)) is not None)
    return single_replies(ids, lengths, statuses), False


class GroupRead(NamedTuple):
    """A group read of servos of one family."""

    frame: bytes
    fast: bool  # whether it asks for a joint reply
    ids: bytes  # of the servos, in the order asked
    lengths: tuple[int, ...]  # of what each sends, bytes
    # Takes a reply that is complete and undamaged, else gives None; None where the lengths differ.
    whole: Callable[[bytes], WholeReply | None] | None
    needed: int  # bytes of the complete reply
    # Takes any reply servo by servo, and tells whether its end has passed.
    parts: Callable[[bytes], tuple[GroupReply, bool]]

    def understand(self, received: bytes, late: bool) -> GroupReply | None:
        """An incomplete or damaged reply as far as it has come; None while the rest may come and is not `late`."""
        if len(received) < self.needed and not late:
            return None
        reply, ended = self.parts(received)
        return None if len(reply.statuses) < len(self.ids) and not (ended or late) else reply
