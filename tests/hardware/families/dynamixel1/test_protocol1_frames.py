"""Frames of Protocol 1.0: built as the maker builds them, and found again in any stream of bytes."""

import dynamixel_sdk as sdk
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.families import frames as codes
from hardware.families import plain_frames as wire
from hardware.families.dynamixel1.family import as_status
from hardware.families.frames import Frame
from hardware.families.plain_frames import LONGEST, PlainParser, build, status_length
from waiting import quick

FRAMES = st.builds(
    Frame, st.integers(0, 253), st.integers(0, 255), st.binary(max_size=40).filter(lambda data: b"\xff" not in data)
)


class Recorder:
    """A port that keeps what the maker's SDK sends."""

    is_using = False

    def __init__(self):
        self.sent = b""

    def clearPort(self):
        pass

    def writePort(self, data):
        self.sent += bytes(data)
        return len(data)

    def setPacketTimeout(self, length):
        pass


@pytest.mark.parametrize(
    ("call", "ours"),
    [
        (lambda packets, port: packets.readTx(port, 7, 36, 2), wire.read(7, 36, 2)),
        (lambda packets, port: packets.write2ByteTxOnly(port, 7, 30, 511), wire.write(7, 30, b"\xff\x01")),
        (
            lambda packets, port: packets.syncWriteTxOnly(port, 30, 2, [1, 0, 2, 2, 255, 1], 6),
            wire.sync_write(30, 2, bytes((1, 0, 2, 2, 255, 1))),
        ),
        (
            lambda packets, port: packets.bulkReadTx(port, [2, 1, 36, 4, 2, 30], 6),
            wire.bulk_read(((1, 36, 2), (2, 30, 4))),
        ),
        (lambda packets, port: packets.txPacket(port, [0, 0, 5, 2, codes.PING, 0]), wire.ping(5)),
    ],
)
def test_instructions_are_the_bytes_of_the_makers_sdk(call, ours):
    port = Recorder()
    call(sdk.PacketHandler(1.0), port)
    assert port.sent == ours


@given(st.lists(FRAMES, max_size=5), st.lists(st.integers(1, 30), min_size=1, max_size=20))
def test_frames_are_found_however_the_bytes_are_cut(frames, sizes):
    data = b"".join(build(*frame) for frame in frames)
    parser, found, at, turn = PlainParser(), [], 0, 0
    while at < len(data):
        size = sizes[turn % len(sizes)]
        found += parser.feed(data[at : at + size])
        at, turn = at + size, turn + 1
    assert found == frames
    assert not parser.waiting


@given(st.binary(max_size=60), FRAMES)
def test_noise_before_a_frame_costs_no_frame_and_nothing_raises(noise, frame):
    parser = PlainParser()
    parser.feed(noise)
    assert frame in parser.feed(build(*frame)) + parser.feed(build(*frame))


def test_a_frame_with_a_bad_checksum_is_dropped_and_its_id_is_known():
    parser = PlainParser()
    broken = bytearray(wire.read(7, 36, 2))
    broken[-1] ^= 1
    assert parser.feed(bytes(broken) + wire.read(8, 36, 2)) == [Frame(8, codes.READ, b"\x24\x02")]
    assert parser.damaged == [7]


def test_a_header_may_begin_with_a_byte_of_noise_that_looks_like_it():
    assert PlainParser().feed(b"\xff" + wire.ping(1)) == [Frame(1, codes.PING, b"")]


@pytest.mark.parametrize("header", [b"\xff\xff\x01\xfa", b"\xff\xff\x01\x50", b"\xff"])
def test_a_stream_of_hostile_headers_costs_linear_time(header):
    """Each promises a long frame; 16 kB of them, byte by byte, once took 4 s."""

    def feed():
        parser = PlainParser()
        for byte in header * (16_000 // len(header)):
            parser.feed(bytes((byte,)))
            assert len(parser._buffer) <= LONGEST + 4

    quick(feed, 0.5)


def test_an_answer_tells_problems_of_the_servo_from_those_of_the_instruction():
    (hot,) = PlainParser().feed(build(3, 4 | 32, b"\x01\x02"))
    status = as_status(hot)
    assert (status.id, status.error, status.alert, status.params, status.hardware) == (3, 0, True, b"\x01\x02", 36)
    (refused,) = PlainParser().feed(build(3, 2))
    assert (as_status(refused).error, as_status(refused).alert) == (6, False)
    assert len(build(3, 0, b"\0\0")) == status_length(2)


@pytest.mark.parametrize(
    ("id", "params", "said"), [(255, b"", "255 is no"), (-1, b"", "-1 is no"), (1, bytes(249), "251 bytes is too long")]
)
def test_what_is_no_frame_cannot_be_built(id, params, said):
    with pytest.raises(ValueError, match=said):
        build(id, codes.PING, params)
