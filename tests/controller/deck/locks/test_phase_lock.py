"""A deck that is locked to beats: steps fall on them, smoothly, whatever the beats do."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import synthetic
from controller.deck.deck import Deck
from controller.deck.locks.phase_lock import correction, wrapped
from controller.wire.messages.arguments import CommandError
from motiondeck_base.errors import MotiondeckError
from wheel import DT, ROUND, Wheel


def play(deck, beats, seconds):
    """Plays on, with beats at times of the deck (s); its time, phase, tempo and state at each tick."""
    waiting, rows = sorted(beats), []
    for _ in range(round(seconds / DT)):
        while waiting and waiting[0] <= deck.time:
            deck.beat(deck.time - waiting.pop(0))
        deck.update(DT)
        rows.append((deck.time, deck.phase, deck.tempo, deck.lock_state))
    return rows


def misses(rows, beats, phase, steps):
    """How far each beat is from the nearest step, s."""
    times = np.array([row[0] for row in rows])
    turned = np.unwrap([row[1] for row in rows], period=1.0)
    at = np.interp(beats, times, turned)
    rate = np.interp(beats, times, np.gradient(turned, times))
    return np.array([wrapped(p - phase, 1.0 / steps) for p in at]) / rate


@settings(max_examples=20)
@given(st.floats(80.0, 140.0), st.floats(0.0, 0.99), st.sampled_from([1, 2]))
def test_a_beat_is_followed_within_20_ms_and_the_state_says_so(rate, start, steps):
    deck = Wheel(start)
    deck.lock("beat", 0.25, steps)
    beats = 0.2 + 60.0 / rate * np.arange(14)
    rows = play(deck, beats, beats[-1] + 0.01)
    assert np.abs(misses(rows, beats[8:], 0.25, steps)).max() < 0.02
    state = rows[-1][3]
    assert (state.source, state.state) == ("beat", "locked")
    assert abs(state.error_ms) < 20.0
    assert state.per_minute == pytest.approx(rate, rel=0.01)
    tempos = np.array([row[2] for row in rows])
    assert np.abs(np.diff(tempos)).max() <= 2.5 * DT + 1e-9
    assert tempos.min() >= 0.0


def test_the_steps_of_a_round_are_those_that_keep_the_tempo_nearest_to_1():
    for period, steps in ((0.8, 1), (0.42, 2), (0.3, 2), (1.2, 1)):
        deck = Wheel()
        rows = play(deck, 0.1 + period * np.arange(8), 8 * period)
        assert rows[-1][2] == pytest.approx(ROUND / (steps * period), rel=0.02)


def test_jittered_lost_and_doubled_beats_are_followed():
    generator = np.random.default_rng(5)
    true = 0.3 + 0.5 * np.arange(30)
    kept = [beat for beat in true if beat < 2.0 or generator.random() > 0.25]
    tapped = [beat + generator.normal(0.0, 0.01) for beat in kept] + [beat + 0.05 for beat in kept[::5]]
    deck = Wheel()
    deck.lock("beat", 0.0, 2)
    rows = play(deck, tapped, true[-1] + 0.1)
    assert np.abs(misses(rows, true[8:], 0.0, 2)).max() < 0.02


def test_when_the_beats_end_it_keeps_their_tempo_and_searches():
    deck = Wheel()
    rows = play(deck, 0.1 + 0.5 * np.arange(8), 12.0)
    assert rows[-1][3].state == "searching"
    assert rows[-1][2] == pytest.approx(ROUND / 1.0, rel=0.01)
    deck.unlock()
    assert deck.lock_state is None
    assert play(deck, [], 1.0)[-1][2] == 1.0


def test_a_tempo_takes_over_and_one_shots_keep_their_own():
    deck = Wheel()
    play(deck, 0.1 + 0.6 * np.arange(6), 4.0)
    deck.set_tempo(0.5)
    assert deck.lock_state is None
    deck = Wheel(loop=False)
    rows = play(deck, 0.1 + 0.6 * np.arange(6), 4.0)
    assert {row[2] for row in rows} == {1.0}
    assert rows[-1][3].state == "searching"


def test_a_pause_holds_the_phase_and_the_beat_is_found_again():
    deck = Wheel()
    deck.lock("beat", 0.0, 2)
    beats = 0.1 + 0.45 * np.arange(40)
    play(deck, beats[beats < 4.0], 4.0)
    deck.pause()
    rows = play(deck, beats[(beats >= 4.0) & (beats < 6.0)], 2.0)
    assert rows[-1][2] == 0.0
    deck.resume()
    rows = play(deck, beats[(beats >= 6.0) & (beats < 10.0)], 4.0)
    assert rows[-1][3].state == "locked"


def test_the_deck_itself_falls_in_step_with_the_beat():
    deck = Deck(synthetic.small_phase_library(), lambda pose: pose.rotation.ravel(), "march", phase=0.3)
    deck.lock("beat", 0.5, 2)
    beats = 0.1 + 0.45 * np.arange(9)
    rows = play(deck, beats, beats[-1] + 0.01)
    assert np.abs(misses(rows, beats[6:], 0.5, 2)).max() < 0.02
    assert rows[-1][3].state == "locked"


def test_what_cannot_be_locked_says_why():
    deck = Wheel()
    with pytest.raises(CommandError, match="STEPS must be a whole number from 0 to 16"):
        deck.lock("beat", 0.0, 99)
    with pytest.raises(CommandError, match="AGO must be a number from -2 to 2"):
        deck.beat(3.0)
    by_itself = Deck(synthetic.small_library(), lambda pose: pose.rotation.ravel(), "march")
    with pytest.raises(MotiondeckError, match="runs by itself: it has no phase"):
        by_itself.beat()
    assert by_itself.lock_state is None


@given(st.floats(-3.0, 3.0), st.floats(0.3, 4.0))
def test_a_correction_brakes_in_time(error, rate):
    """A tempo that follows the correction as fast as it may ends at the reference and does not go far beyond."""
    tempo, before = 0.0, abs(error)
    for _ in itertools.repeat(None, 2000):
        wanted = correction(error, rate)
        tempo += min(max(wanted - tempo, -rate * DT), rate * DT)
        error -= tempo * DT
    assert abs(error) < 1e-3 + 0.02 * before
