"""Frames, signs and group reads of Feetech STS servos."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.families import plain_frames as wire
from hardware.families.feetech.family import FAMILY, as_status, group_read, lines
from hardware.families.models import MODELS
from hardware.families.plain_frames import PlainParser, build

STS = MODELS["STS3215"]

# From the maker's protocol manual, or as its SDK sends them.
GOLDEN = {
    "ping": (wire.ping(1), "FFFF 01 02 01 FB"),
    "read": (wire.read(1, 56, 2), "FFFF 01 04 02 38 02 BE"),
    "write": (wire.write(1, 42, bytes.fromhex("00080000E803")), "FFFF 01 09 03 2A 0008 0000 E803 D5"),
    "sync read": (wire.sync_read(56, 8, [1, 2]), "FFFF FE 06 82 38 08 01 02 36"),
}
IDS = st.integers(0, 253)


@pytest.mark.parametrize("name", GOLDEN)
def test_instructions_are_those_of_the_manual(name):
    frame, printed = GOLDEN[name]
    assert frame == bytes.fromhex(printed)


@given(st.lists(st.tuples(IDS, st.integers(0, 255), st.binary(max_size=40)), min_size=1, max_size=5), st.data())
def test_frames_are_found_again_in_any_pieces(frames, data):
    sent = b"".join(build(*frame) for frame in frames)
    parser, found, at = PlainParser(), [], 0
    while at < len(sent):
        size = data.draw(st.integers(1, len(sent) - at))
        found += parser.feed(sent[at : at + size])
        at += size
    assert [(one.id, one.instruction, one.params) for one in found] == frames


@given(st.binary(max_size=300))
def test_no_bytes_make_it_raise(noise):
    for frame in PlainParser().feed(noise):
        as_status(frame)


@pytest.mark.parametrize(
    ("name", "bit"),
    [("homing_offset", 11), ("goal_position", 15), ("present_velocity", 15), ("present_load", 10)],
)
@given(size=st.integers(0, 1023), negative=st.booleans())
def test_numbers_are_a_size_and_a_sign(name, bit, size, negative):
    register = STS[name]
    value = -size if negative else size
    raw = register.encode(value)
    assert int.from_bytes(raw, "little") == size | (1 << bit if negative and size else 0)
    assert register.decode(raw) == value


@given(st.dictionaries(IDS, st.tuples(st.integers(0, 47), st.binary(min_size=6, max_size=6)), min_size=2, max_size=8))
def test_a_whole_reply_and_one_taken_servo_by_servo_say_the_same(said):
    request = group_read(tuple((id, 56, 6) for id in said), False)
    received = b"".join(build(id, error, data) for id, (error, data) in said.items())
    assert len(received) == request.needed
    whole = request.whole(received)
    by_servo = request.understand(received, True)
    assert whole.statuses(request.ids).keys() == by_servo.statuses.keys() == said.keys()
    for id, (error, data) in said.items():
        for status in (whole.statuses(request.ids)[id], by_servo.statuses[id]):
            assert (status.error, status.alert, status.params) == (0, error != 0, data)


@given(st.integers(0, 35), st.integers(0, 7))
def test_a_damaged_reply_is_not_taken_whole(place, bit):
    request = group_read(((1, 56, 6), (2, 56, 6), (3, 56, 6)), False)
    received = bytearray(b"".join(build(id, 0, bytes(6)) for id in (1, 2, 3)))
    received[place] ^= 1 << bit
    reply = request.whole(bytes(received))
    # Only the error byte's own sum would notice two faults that cancel each other; one never passes.
    assert reply is None


def test_only_the_same_registers_are_asked_for_together():
    blocks = ((1, 56, 2), (2, 56, 2), (3, 40, 1))
    assert list(lines(blocks)) == [((1, 56, 2), (2, 56, 2)), ((3, 40, 1),)]
    with pytest.raises(ValueError, match="the same registers"):
        group_read(blocks, False)


def test_its_problems_are_the_usual_ones():
    series = STS.series
    assert [series.usual_problems(bits) for bits in (1, 2, 4, 8, 32)] == [1, 8, 4, 32, 32]
    assert series.own_problems(4 | 32) == STS["shutdown"].default
    assert FAMILY.identification.read(bytes((3, 6, 0, 9, 3, 1))) == (777, 3)
