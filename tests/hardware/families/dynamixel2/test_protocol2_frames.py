from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hardware.families.dynamixel2.frames import (
    BROADCAST,
    HEADER,
    LONGEST,
    Frame,
    Parser,
    as_status,
    build,
    build_status,
    checksum,
    stuff,
    unstuff,
)
from waiting import quick

# Bytes that are mostly the ones a header is made of: where framing goes wrong if it does.
tricky = st.lists(st.sampled_from([0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x01, 0x55]), max_size=60).map(bytes)
anything = st.one_of(tricky, st.binary(max_size=60))
instructions = st.sampled_from([0x01, 0x02, 0x03, 0x82, 0x83, 0x8A, 0xFD, 0xFF])


def in_pieces(data, cuts):
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    return [data[start:end] for start, end in pairwise(edges)]


def test_the_checksum_is_the_standard_one():
    assert checksum(b"123456789") == 0xFEE8


@given(st.binary(), st.binary())
def test_a_checksum_can_be_carried_on(first, second):
    assert checksum(second, checksum(first)) == checksum(first + second)


@given(anything)
@example(bytes.fromhex("fffffdfffdfd"))  # comes back one byte short from the maker's own client
@example(bytes.fromhex("fffffdfffffdfffffd"))
def test_unstuffing_undoes_stuffing(body):
    assert unstuff(stuff(body)) == body


@given(anything)
def test_a_stuffed_body_holds_no_header(body):
    stuffed = stuff(body) + b"\x00"
    at = stuffed.find(b"\xff\xff\xfd")
    while at >= 0:
        assert stuffed[at + 3] == 0xFD
        at = stuffed.find(b"\xff\xff\xfd", at + 1)


@given(st.integers(0, 252), instructions, anything, st.lists(st.integers(0, 200), max_size=5))
def test_a_frame_is_found_however_it_arrives(id, instruction, params, cuts):
    parser = Parser()
    found = [frame for piece in in_pieces(build(id, instruction, params), cuts) for frame in parser.feed(piece)]
    assert found == [Frame(id, instruction, params)]
    assert parser.corrupt == 0


@given(st.lists(anything, max_size=8))
def test_no_bytes_make_the_parser_raise_or_hoard(pieces):
    parser = Parser()
    for piece in pieces:
        parser.feed(piece)
        assert len(parser._buffer) <= LONGEST + 7


@given(anything, st.integers(0, 252), anything, st.lists(st.integers(0, 200), max_size=5))
@example(HEADER + b"\x01\xff\x0f\x03", 7, b"\x00", [])  # noise that promises a long frame
@example(b"\xff\xff", 7, b"", [])
def test_behind_any_noise_the_next_good_frame_is_found(noise, id, params, cuts):
    parser = Parser()
    good = build(id, 0x03, params)
    found = [frame for piece in in_pieces(noise + good, cuts) for frame in parser.feed(piece)]
    assert found[-1:] == [Frame(id, 0x03, params)]


@given(st.integers(0, 252), anything, st.data())
def test_a_flipped_bit_costs_that_frame_and_no_other(id, params, data):
    damaged = bytearray(build(id, 0x02, params))
    at = data.draw(st.integers(0, len(damaged) - 1))
    damaged[at] ^= 1 << data.draw(st.integers(0, 7))
    assert Parser().feed(bytes(damaged) + build(9, 0x01)) == [Frame(9, 0x01, b"")]


frames = st.builds(build, st.integers(0, 252), instructions, tricky)


@given(
    st.lists(st.one_of(tricky, st.binary(max_size=8), frames), max_size=6),
    st.lists(st.integers(0, 400), max_size=8),
)
@example([HEADER + b"\x01\x20\x00\x02", build(5, 0x02, b"\x01"), bytes(40)], [30])
def test_what_is_found_does_not_depend_on_the_pieces(parts, cuts):
    stream = b"".join(parts)
    whole, pieces = Parser(), Parser()
    at_once = whole.feed(stream)
    assert [frame for piece in in_pieces(stream, cuts) for frame in pieces.feed(piece)] == at_once
    assert pieces.corrupt == whole.corrupt


@pytest.mark.parametrize("length", [LONGEST + 1, 0xFFFF, 2, 0])
def test_a_length_that_no_frame_has_is_dropped_at_once(length):
    """Waiting for its end would keep the parser deaf for as long as the noise claims."""
    parser = Parser()
    assert parser.feed(HEADER + b"\x01" + length.to_bytes(2, "little")) == []
    assert (parser.corrupt, parser.waiting) == (1, False)


@pytest.mark.parametrize("params", [LONGEST - 3, 0])
def test_the_longest_and_the_shortest_frame_are_found(params):
    assert Parser().feed(build(1, 0x03, bytes(params))) == [Frame(1, 0x03, bytes(params))]


@pytest.mark.parametrize(
    "header", [b"\xff\xff\xfd\x00\x01\xff\x1f", b"\xff\xff\xfd\x00\xfe\xff\x1f\x55"], ids=["plain", "fast reply"]
)
def test_a_stream_of_hostile_headers_costs_linear_time(header):
    """Each promises the longest frame; 8 kB of them, byte by byte, once took 3.5 s."""

    def feed():
        parser = Parser()
        for byte in header * (16_000 // len(header)):
            parser.feed(bytes((byte,)))

    quick(feed, 0.5)


def test_a_bad_checksum_is_counted():
    parser = Parser()
    assert parser.feed(build(1, 0x01)[:-1] + b"\x00") == []
    assert parser.corrupt == 1


def test_an_alert_is_a_field_of_the_status():
    (frame,) = Parser().feed(build_status(3, 7, b"\x2a", alert=True))
    status = as_status(frame)
    assert status is not None
    assert (status.id, status.error, status.alert, status.params) == (3, 7, True, b"\x2a")


def test_what_is_no_status_of_one_servo_is_not_taken_for_one():
    assert as_status(Frame(1, 0x02, b"\x00\x00")) is None
    assert as_status(Frame(BROADCAST, 0x55, b"\x00\x01")) is None
    assert as_status(Frame(1, 0x55, b"")) is None


@pytest.mark.parametrize("id", [-1, 253, 255])
def test_an_impossible_id_is_refused(id):
    with pytest.raises(ValueError, match="0 to 252"):
        build(id, 0x01)


def test_a_frame_longer_than_any_is_refused():
    with pytest.raises(ValueError, match="too long"):
        build(1, 0x03, bytes(LONGEST))
