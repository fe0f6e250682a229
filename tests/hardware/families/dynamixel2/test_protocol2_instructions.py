"""Bytes from the maker's e-Manual, and the joint reply to a fast read."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.families import frames as codes
from hardware.families.dynamixel2 import frames as wire
from hardware.families.dynamixel2.frames import build, build_status, checksum
from hardware.families.dynamixel2.group_reply import (
    fast_format,
    fast_reply,
    fast_reply_length,
    single_format,
)
from hardware.families.models import USUAL
from hardware.families.replies import single_replies


def statuses_in(received):
    return [status for frame in USUAL.parser().feed(received) if (status := USUAL.as_status(frame)) is not None]


GOLDEN = {
    "ping": (wire.ping(1), "FFFFFD00 01 0300 01 194E"),
    "read": (wire.read(1, 132, 4), "FFFFFD00 01 0700 02 84000400 1D15"),
    "write": (wire.write(1, 116, (512).to_bytes(4, "little")), "FFFFFD00 01 0900 03 740000020000 CA89"),
    "action": (build(1, codes.ACTION), "FFFFFD00 01 0300 05 02CE"),
    "reboot": (wire.reboot(1), "FFFFFD00 01 0300 08 2F4E"),
    "sync read": (wire.sync_read(132, 4, [1, 2]), "FFFFFD00 FE 0900 82 84000400 0102 CEFA"),
    "fast sync read": (wire.sync_read(132, 4, [3, 7, 4], fast=True), "FFFFFD00 FE 0A00 8A 84000400 030704 20F2"),
    "status of a ping": (build_status(1, 0, bytes.fromhex("060426")), "FFFFFD00 01 0700 55 00 060426 655D"),
    "status of a read": (build_status(1, 0, bytes.fromhex("A6000000")), "FFFFFD00 01 0800 55 00 A6000000 8CC0"),
    "status of a write": (build_status(1), "FFFFFD00 01 0400 55 00 A10C"),
}

# The joint reply of the ids 3, 7 and 4, of which the e-Manual prints the first two pieces.
PIECE_3 = bytes.fromhex("FFFFFD00FE190055 0003A6000000 8408")
PIECE_7 = bytes.fromhex("00071F080000 16CA")


def joint_reply(ids, values, length=4):
    """As servos write it one behind the other."""
    size = 1 + len(ids) * (length + 4)
    reply = bytes.fromhex("FFFFFD00FE") + size.to_bytes(2, "little") + b"\x55"
    for id, value in zip(ids, values, strict=True):
        reply += bytes((0, id)) + value.to_bytes(length, "little")
        reply += checksum(reply).to_bytes(2, "little")
    return reply


@pytest.mark.parametrize("name", GOLDEN)
def test_frames_are_those_of_the_manual(name):
    built, printed = GOLDEN[name]
    assert built == bytes.fromhex(printed)


def test_group_writes_say_who_gets_what():
    assert wire.sync_write(116, 1, b"\x01\xaa\x02\xbb")[7:-2] == bytes.fromhex("83 7400 0100 01AA 02BB")
    assert wire.bulk_read([(1, 132, 4), (2, 146, 1)])[7:-2] == bytes.fromhex("92 01 8400 0400 02 9200 0100")


def test_the_manuals_joint_reply_is_understood():
    received = joint_reply([3, 7, 4], [0xA6, 0x81F, 0x55])
    assert received.startswith(PIECE_3 + PIECE_7)
    reply = fast_reply(received, [3, 7, 4], [4] * 3)
    assert [(id, int.from_bytes(status.params, "little")) for id, status in reply.statuses.items()] == [
        (3, 0xA6),
        (7, 0x81F),
        (4, 0x55),
    ]
    assert reply[1:] == ([], [], [])
    assert len(received) == fast_reply_length(3, 4)


def test_a_reply_that_breaks_off_is_good_up_to_there():
    reply = fast_reply(PIECE_3 + PIECE_7[:-1], [3, 7, 4], [4] * 3)
    assert list(reply.statuses) == [3]
    assert (reply.silent, reply.unheard) == ([7], [4])


def test_a_servo_that_is_left_out_costs_only_itself():
    reply = fast_reply(PIECE_3 + PIECE_7, [3, 5, 7], [4] * 3)
    assert list(reply.statuses) == [3, 7]
    assert reply.silent == [5]


def test_a_corrupt_byte_costs_only_its_servo():
    damaged = bytearray(joint_reply([3, 7, 4], [1, 2, 3]))
    damaged[8 + 8 + 3] ^= 0x40
    reply = fast_reply(bytes(damaged), [3, 7, 4], [4] * 3)
    assert reply.corrupt == [7]
    assert {id: status.params[0] for id, status in reply.statuses.items()} == {3: 1, 4: 3}


@given(st.binary(max_size=40), st.lists(st.integers(0, 252), min_size=1, max_size=6, unique=True), st.integers(0, 10))
def test_no_bytes_make_the_reader_of_joint_replies_raise(received, ids, length):
    head = bytes.fromhex("FFFFFD00FE190055")
    for start in (b"", head, head + b"\x00" + bytes(ids)):
        reply = fast_reply(start + received, ids, [length] * len(ids))
        assert {*reply.statuses, *reply.corrupt, *reply.silent, *reply.unheard} == set(ids)


@given(st.binary(max_size=12), st.lists(st.integers(0, 252), min_size=1, max_size=5, unique=True), st.data())
def test_a_joint_reply_is_found_behind_noise(noise, ids, data):
    values = data.draw(st.lists(st.integers(0, 2**32 - 1), min_size=len(ids), max_size=len(ids)))
    reply = fast_reply(noise + joint_reply(ids, values), ids, [4] * len(ids))
    assert {id: int.from_bytes(status.params, "little") for id, status in reply.statuses.items()} == dict(
        zip(ids, values, strict=True)
    )


def whole(ids, values, alert=()):
    """Undamaged single statuses with two data bytes each."""
    return b"".join(
        build_status(id, 0, value.to_bytes(2, "little"), id in alert) for id, value in zip(ids, values, strict=True)
    )


@given(st.lists(st.integers(0, 252), min_size=1, max_size=6, unique=True), st.data())
def test_undamaged_statuses_are_taken_in_one_pass(ids, data):
    values = data.draw(st.lists(st.integers(0, 65000), min_size=len(ids), max_size=len(ids)))
    alert = data.draw(st.sets(st.sampled_from(ids)))
    received = whole(ids, values, alert)
    reply = single_format(bytes(ids), 2)(received)
    assert reply is not None
    assert reply.statuses(ids) == single_replies(ids, [2] * len(ids), statuses_in(received)).statuses
    joint = joint_reply(ids, values, 2)
    rows = fast_format(bytes(ids), 2)(joint)
    assert rows is not None
    assert rows.statuses(ids) == fast_reply(joint, ids, [2] * len(ids)).statuses


@given(st.lists(st.integers(0, 252), min_size=2, max_size=6, unique=True), st.data())
def test_one_flipped_bit_is_never_taken_in_one_pass(ids, data):
    fast = data.draw(st.booleans())
    damaged = bytearray(joint_reply(ids, range(len(ids)), 2) if fast else whole(ids, range(len(ids))))
    at = data.draw(st.integers(0, len(damaged) - 1))
    damaged[at] ^= 1 << data.draw(st.integers(0, 7))
    assert (fast_format if fast else single_format)(bytes(ids), 2)(bytes(damaged)) is None


def test_statuses_in_another_order_or_of_other_servos_are_not_taken_in_one_pass():
    received = whole([1, 2, 3], [10, 20, 30])
    for ids in ([1, 3, 2], [1, 2], [1, 2, 4], [1, 2, 3, 4]):
        assert single_format(bytes(ids), 2)(received) is None
        assert fast_format(bytes(ids), 2)(joint_reply([1, 2, 3], [1, 2, 3], 2)) is None


def test_a_servo_silent_among_single_statuses_is_named():
    reply = single_replies([1, 2, 3, 4, 5], [2] * 5, statuses_in(whole([1, 3], [10, 30])))
    assert (list(reply.statuses), reply.silent, reply.unheard) == ([1, 3], [2, 4], [5])
