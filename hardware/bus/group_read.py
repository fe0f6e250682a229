"""A group read: what it asks, and what the bytes that come back mean; `Bus` sends and waits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from hardware.protocol1 import instructions as old_words
from hardware.protocol1.frames import OldParser
from hardware.protocol1.frames import as_status as old_status
from hardware.protocol1.frames import status_length as old_status_length
from hardware.protocol2 import instructions
from hardware.protocol2.frames import StatusPacket
from hardware.protocol2.group_reply import (
    FastFormat,
    GroupReply,
    SingleFormat,
    WholeReply,
    fast_reply,
    fast_reply_length,
    fast_reply_start,
    single_replies,
    status_length,
)

Blocks = tuple[tuple[int, int, int], ...]
"""(id, address, length): what to read of each servo."""


class GroupRead(NamedTuple):
    """A group read of servos of one protocol.

    Attributes:
        frame: the bytes of the instruction.
        fast: whether it asks for a joint reply.
        ids: of the servos, in the order asked.
        lengths: of what each sends, bytes.
        whole: takes a reply that is all there and undamaged, else gives None; None where the lengths differ.
        needed: how many bytes the whole reply has.
        old: whether it is about servos of Protocol 1.0.
    """

    frame: bytes
    fast: bool
    ids: bytes
    lengths: tuple[int, ...]
    whole: Callable[[bytes], WholeReply | None] | None
    needed: int
    old: bool

    def understand(self, received: bytes, late: bool) -> GroupReply | None:
        """A reply that is not whole as far as it has come: with noise, stuffing, damage or a missing servo.

        None while the rest may still be on its way, which it is not when `late`.
        """
        if len(received) < self.needed and not late:
            return None
        if self.old:
            reply, ended = single_replies(received, self.ids, self.lengths, _old_statuses), False
        else:
            reply = (fast_reply if self.fast else single_replies)(received, self.ids, self.lengths)
            ended = self.fast and len(received) - max(0, fast_reply_start(received)) >= self.needed
        return None if len(reply.statuses) < len(self.ids) and not (ended or late) else reply


def group_read(blocks: Blocks, fast: bool, old: bool) -> GroupRead:
    """A sync read where all are asked for the same, else a bulk read; under Protocol 1.0 a read where there is one.

    Args:
        blocks: of servos of one protocol.
        fast: whether all answer in one joint reply.
        old: whether they speak Protocol 1.0.
    """
    lengths = tuple(length for _, _, length in blocks)
    ids = bytes(id for id, _, _ in blocks)
    id, address, length = blocks[0]
    if old:
        frame = old_words.read(id, address, length) if len(blocks) == 1 else old_words.bulk_read(blocks)
        return GroupRead(frame, fast, ids, lengths, None, len(ids) * old_status_length(0) + sum(lengths), True)
    if all(block[1:] == (address, length) for block in blocks):
        frame = (instructions.fast_sync_read if fast else instructions.sync_read)(address, length, ids)
    else:
        frame = (instructions.fast_bulk_read if fast else instructions.bulk_read)(blocks)
    empty = fast_reply_length(len(ids), 0) if fast else len(ids) * status_length(0)
    whole = (FastFormat if fast else SingleFormat)(ids, length).whole if len(set(lengths)) == 1 else None
    return GroupRead(frame, fast, ids, lengths, whole, empty + sum(lengths), False)


def _old_statuses(received: bytes) -> Iterator[StatusPacket]:
    """The answers of Protocol 1.0 in what was received."""
    return (status for frame in OldParser().feed(received) if (status := old_status(frame)) is not None)
