"""MIDI's clock and timecode, judged by counting frames one by one."""

from functools import cache
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motiondeck.stage.midi import MidiClock
from motiondeck.stage.timecode import Timecode, TimecodeReader


def beats(messages):
    clock = MidiClock()
    return [number for number, (kind, position) in enumerate(messages) if clock.take(kind, position)]


def pulses(count):
    return [("clock", 0)] * count


def test_every_24th_pulse_is_a_beat_from_the_start_on():
    assert beats(pulses(50)) == [0, 24, 48]
    assert beats([*pulses(5), ("start", 0), *pulses(30)]) == [0, 6, 30]


def test_a_stopped_clock_has_no_beats_and_goes_on_where_it_is_put():
    assert beats([("start", 0), *pulses(10), ("stop", 0), *pulses(40), ("continue", 0), *pulses(15)]) == [1, 67]
    # Six sixteenths are a quarter and a half: the next beat is half a quarter on.
    assert beats([("stop", 0), ("songpos", 6), ("continue", 0), *pulses(13)]) == [15]


RATES = {0: 24, 1: 25, 2: 30, 3: 30}


@cache
def all_frames(kind):
    """Every frame of an hour and a bit, counted one by one."""
    return [
        Timecode(minute // 60, minute % 60, second, frame)
        for minute in range(61)
        for second in range(60)
        for frame in range(RATES[kind])
        if not (kind == 2 and minute % 10 and second == 0 and frame < 2)
    ]


@pytest.mark.parametrize("kind", RATES)
def test_frames_are_numbered_without_gaps(kind):
    frames = [time.number(kind) for time in all_frames(kind)]
    assert frames == list(range(len(frames)))


def send(reader, time, kind, pieces=range(8)):
    values = (time.frames, time.seconds, time.minutes, time.hours | kind << 5)
    return [reader.quarter_frame(piece, values[piece // 2] >> 4 * (piece % 2) & 15) for piece in pieces]


@given(st.sampled_from(sorted(RATES)), st.integers(0, 80_000), st.integers(0, 7), st.integers(3, 20))
def test_what_is_passed_is_contiguous_and_each_time_lies_in_it_once(kind, first, piece, groups):
    reader, frames = TimecodeReader(), all_frames(kind)
    passed = send(reader, frames[first], kind, range(piece, 8))
    for group in range(1, groups):
        passed += send(reader, frames[first + 2 * group], kind)
    known = [span for span in passed if span is not None]
    begins = first if piece == 0 else first + 2
    for number in range(begins, first + 2 * groups - 1):
        assert [span.contains(frames[number]) for span in known].count(True) == 1
    assert all(a.until == b.after for a, b in pairwise(known))
    assert known[-1].until == first + 2 * (groups - 1) + 1.75


def test_what_is_jumped_over_or_passed_backwards_is_not_passed():
    reader, cue = TimecodeReader(), Timecode(0, 0, 10, 0)
    spans = send(reader, Timecode(0, 0, 5, 0), 1) + send(reader, Timecode(0, 0, 15, 0), 1)
    assert not any(span.contains(cue) for span in spans if span is not None)
    back = [span for frame in range(10, 0, -2) for span in send(reader, Timecode(0, 0, 10, frame), 1, range(7, -1, -1))]
    assert [span for span in back if span is not None and span.contains(cue)] == []


def test_an_impossible_time_is_left_out():
    reader = TimecodeReader()
    assert send(reader, Timecode(0, 0, 0, 29), 1)[-1] is None
    assert send(reader, Timecode(0, 0, 1, 0), 1)[-1] is not None
