"""Group reads, and their replies: one frame that all servos write together (fast reads), or one status a servo."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from hardware.families.dynamixel2 import frames as instructions
from hardware.families.dynamixel2.frames import ALERT, HEADER, STATUS, Parser, as_status, checksum
from hardware.families.frames import BROADCAST, StatusPacket
from hardware.families.replies import Blocks, GroupRead, GroupReply, WholeReply, in_order, whole_reply

_JOINT_HEAD = HEADER + bytes((BROADCAST,))  # how every joint reply begins
_FAST_HEAD = 8  # header, BROADCAST, length, STATUS: what the first servo sends before its piece
_STATUS_HEAD = 8  # header, ID, length, STATUS: what stands before the error byte of a single status


def status_length(length: int) -> int:
    """How many bytes a status with `length` parameter bytes has on the wire when nothing in it needs stuffing."""
    return 11 + length


def fast_reply_length(count: int, length: int) -> int:
    """How many bytes the joint reply of `count` servos, `length` bytes each, has on the wire."""
    return _FAST_HEAD + count * (length + 4)


def fast_reply_start(received: bytes) -> int:
    """Where the joint reply begins in what was received; -1 if nowhere yet."""
    start = received.find(_JOINT_HEAD)
    while start >= 0 and received[start + 7 : start + 8] not in (b"", bytes((STATUS,))):
        start = received.find(_JOINT_HEAD, start + 1)
    return start


def fast_format(ids: bytes, length: int) -> Callable[[bytes], WholeReply | None]:
    """What takes the joint reply of some servos, `length` bytes each, if all of it is in what was received, undamaged.

    A loop asks for the same again and again, and wakes up with cold caches: what can be made before is made once.
    """
    stride = length + 4
    size = 1 + len(ids) * stride
    head = _JOINT_HEAD + bytes((size & 0xFF, size >> 8, STATUS))
    crc, end = checksum(head), _FAST_HEAD + len(ids) * stride

    def whole(received: bytes) -> WholeReply | None:
        # It nearly always begins the reply; find() itself costs some us behind a sleep.
        start = 0 if received.startswith(head) else received.find(head)
        rows = received[start + _FAST_HEAD : start + end]
        # Each checksum covers everything before it, so the last one speaks for all.
        if start < 0 or rows[1::stride] != ids or checksum(rows[:-2], crc) != rows[-2] | rows[-1] << 8:
            return None
        return whole_reply((rows, stride, 0, 2, ALERT, 2))

    return whole


def single_format(ids: bytes, length: int) -> Callable[[bytes], WholeReply | None]:
    """What takes the statuses of some servos, `length` bytes each, if all are there, undamaged and alone.

    All checksums are verified in one pass: with its two checksum bytes swapped, each undamaged frame takes the CRC from
    0 back to 0, so the CRC over all is 0; and a CRC that has left 0 does not come back to it through undamaged frames.
    """
    stride, size = status_length(length), length + 4
    begin = b"".join(HEADER + bytes((id, size & 0xFF, size >> 8, STATUS)) for id in ids)
    heads = np.frombuffer(begin, dtype=np.uint8).reshape(len(ids), _STATUS_HEAD)
    swapped = np.zeros((len(ids), stride), dtype=np.uint8)

    def whole(received: bytes) -> WholeReply | None:
        if len(received) != swapped.size:
            return None
        rows = np.frombuffer(received, dtype=np.uint8).reshape(swapped.shape)
        if not np.array_equal(rows[:, :_STATUS_HEAD], heads):
            return None
        swapped[:] = rows
        swapped[:, -2:] = rows[:, :-3:-1]
        if checksum(swapped.tobytes()) != 0:
            return None
        return whole_reply((received, stride, _STATUS_HEAD, _STATUS_HEAD + 1, ALERT, 2))

    return whole


def fast_reply(received: bytes, ids: Sequence[int], lengths: Sequence[int]) -> GroupReply:
    """Reads the joint reply of the servos `ids`, asked in this order for `lengths` bytes."""
    # Behind FF FF FD 00 FE LENGTH 55 each servo sends  error, ID, data, CRC,  where its CRC covers everything on the
    # wire before it, the earlier CRCs included. So a reply that breaks off is good up to there; and because the next
    # piece is checked from the CRC as it arrived, a corrupt byte costs only the servo that it belongs to.
    statuses: dict[int, StatusPacket] = {}
    corrupt: list[int] = []
    silent: list[int] = []
    start = fast_reply_start(received)
    turn = 0
    if start >= 0:
        at = start + _FAST_HEAD
        crc = checksum(received[start:at])
        while turn < len(ids) and at + (size := lengths[turn] + 4) <= len(received):
            tail = received[at + size - 2 : at + size]
            sent = int.from_bytes(tail, "little")
            error, id = received[at], received[at + 1]
            if checksum(received[at : at + size - 2], crc) != sent:
                corrupt.append(ids[turn])
            elif id in ids[turn:]:
                while ids[turn] != id:
                    silent.append(ids[turn])
                    turn += 1
                statuses[id] = StatusPacket(id, error & ~ALERT, bool(error & ALERT), received[at + 2 : at + size - 2])
            else:
                break
            crc = checksum(tail, sent)
            at += size
            turn += 1
    return GroupReply(statuses, corrupt, silent + list(ids[turn : turn + 1]), list(ids[turn + 1 :]))


def group_read(blocks: Blocks, fast: bool) -> GroupRead:
    """A sync read where all are asked for the same, else a bulk read; answered in one joint reply if `fast`."""
    lengths = tuple(length for _, _, length in blocks)
    ids = bytes(id for id, _, _ in blocks)
    _, address, length = blocks[0]
    alike = all(block[1:] == (address, length) for block in blocks)
    frame = instructions.sync_read(address, length, ids, fast) if alike else instructions.bulk_read(blocks, fast)
    needed = (fast_reply_length(len(ids), 0) if fast else len(ids) * status_length(0)) + sum(lengths)
    whole = (fast_format if fast else single_format)(ids, length) if len(set(lengths)) == 1 else None
    parts = partial(_joint, ids, lengths, needed) if fast else partial(in_order, Parser, as_status, ids, lengths)
    return GroupRead(frame, fast, ids, lengths, whole, needed, parts)


def _joint(ids: bytes, lengths: Sequence[int], needed: int, received: bytes) -> tuple[GroupReply, bool]:
    ended = len(received) - max(0, fast_reply_start(received)) >= needed
    return fast_reply(received, ids, lengths), ended
