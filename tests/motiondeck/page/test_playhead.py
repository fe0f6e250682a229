"""The playhead stays within its motion whatever is done to it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motiondeck.page.clip_page import Playhead

ACTIONS = st.one_of(
    st.tuples(st.just("advance"), st.floats(0.0, 20.0)),
    st.tuples(st.just("step"), st.integers(-500, 500)),
    st.tuples(st.just("seek"), st.floats(-5.0, 50.0)),
    st.tuples(st.just("tempo"), st.floats(0.05, 3.0)),
    st.tuples(st.just("playing"), st.booleans()),
)


@given(st.integers(1, 300), st.floats(1.0, 240.0), st.lists(ACTIONS, max_size=30))
def test_the_frame_is_always_one_of_the_motion(frames, rate, actions):
    head = Playhead(frames, rate)
    for name, value in actions:
        if name in ("tempo", "playing"):
            setattr(head, name, value)
        else:
            getattr(head, name)(value)
        assert 0 <= head.frame < frames


def test_time_passes_at_its_tempo_and_begins_again():
    head = Playhead(frames=120, rate=60.0)
    head.advance(0.5)
    assert (head.frame, head.seconds) == (30, 0.5)
    head.tempo = 2.0
    head.advance(0.5)
    assert head.frame == 90
    head.advance(0.25)
    assert head.frame == 0


def test_a_step_stops_and_is_one_frame():
    head = Playhead(frames=10, rate=60.0)
    head.advance(0.04)
    head.step(1)
    assert (head.frame, head.playing) == (3, False)
    head.advance(1.0)
    head.step(-1)
    assert head.frame == 2
    head.step(-100)
    assert head.frame == 0
    head.seek(0.1)
    assert head.frame == 6
    head.seek(9.0)
    assert head.seconds == pytest.approx(0.15)
