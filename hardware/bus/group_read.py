"""A group read: its instruction frame, and the parsing of the reply; `Bus` sends and waits."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from hardware.bus.protocol import Protocol
from hardware.families.dynamixel2.group_reply import (
    FastFormat,
    GroupReply,
    SingleFormat,
    WholeReply,
    fast_reply,
    fast_reply_length,
    fast_reply_start,
    single_replies,
)

Blocks = tuple[tuple[int, int, int], ...]
"""(id, address, length): what to read of each servo."""


class GroupRead(NamedTuple):
    """A group read of servos of one protocol.

    Attributes:
        fast: whether it asks for a joint reply.
        ids: of the servos, in the order asked.
        lengths: of what each sends, bytes.
        whole: takes a reply that is complete and undamaged, else gives None; None where the lengths differ.
        needed: bytes of the complete reply.
    """

    frame: bytes
    fast: bool
    ids: bytes
    lengths: tuple[int, ...]
    whole: Callable[[bytes], WholeReply | None] | None
    needed: int
    protocol: Protocol

    def understand(self, received: bytes, late: bool) -> GroupReply | None:
        """An incomplete or damaged reply as far as it has come.

        None while the rest may still be on its way, which it is not when `late`.
        """
        if len(received) < self.needed and not late:
            return None
        ended = False
        if self.fast:
            reply = fast_reply(received, self.ids, self.lengths)
            ended = len(received) - max(0, fast_reply_start(received)) >= self.needed
        else:
            reply = single_replies(self.ids, self.lengths, self.protocol.statuses(received))
        return None if len(reply.statuses) < len(self.ids) and not (ended or late) else reply


def group_read(blocks: Blocks, fast: bool, protocol: Protocol) -> GroupRead:
    """A sync read where all are asked for the same, else a bulk read; under Protocol 1.0 a read where there is one.

    Args:
        blocks: of servos of one protocol.
        fast: whether those that can answer in one joint reply.
    """
    lengths = tuple(length for _, _, length in blocks)
    ids = bytes(id for id, _, _ in blocks)
    id, address, length = blocks[0]
    words = protocol.instructions
    needed = len(ids) * protocol.status_length(0) + sum(lengths)
    if not protocol.group_reads:
        frame = words.read(id, address, length) if len(blocks) == 1 else words.bulk_read(blocks)
        return GroupRead(frame, False, ids, lengths, None, needed, protocol)
    if all(block[1:] == (address, length) for block in blocks):
        frame = (words.fast_sync_read if fast else words.sync_read)(address, length, ids)
    else:
        frame = (words.fast_bulk_read if fast else words.bulk_read)(blocks)
    needed = fast_reply_length(len(ids), 0) + sum(lengths) if fast else needed
    whole = (FastFormat if fast else SingleFormat)(ids, length).whole if len(set(lengths)) == 1 else None
    return GroupRead(frame, fast, ids, lengths, whole, needed, protocol)
