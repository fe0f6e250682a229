"""A deck that is locked to its body waits while it is held, goes where a hand takes it, and goes on without a jump."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.deck.locks.phase_lock import wrapped
from motiondeck_base.errors import MotiondeckError
from wheel import DT, Wheel


class Body:
    """Joints that follow their targets with a lag, unless a hand holds some of them."""

    def __init__(self, deck, lag=0.02):
        self.deck, self.share, self.at, self.held = deck, DT / lag, deck.targets.copy(), None
        deck.measured = lambda: self.at

    def play(self, seconds, noise=None):
        """Time after time the phase, the tempo and the targets."""
        rows = []
        for _ in range(round(seconds / DT)):
            self.deck.update(DT)
            self.at = self.at + self.share * (self.deck.targets - self.at)
            if noise is not None:
                self.at = self.at + noise.normal(0.0, 0.003, 3)
            if self.held is not None:
                self.at = np.where(np.isnan(self.held), self.at, self.held)
            rows.append((self.deck.phase, self.deck.tempo, *self.deck.targets))
        return np.array(rows)


def locked(seconds=1.6, tempo=1.0):
    deck = Wheel(0.0, seconds)
    deck.set_tempo(tempo)
    body = Body(deck)
    deck.lock("body")
    body.play(2.0 * seconds / abs(tempo))
    return deck, body


def test_a_body_that_follows_is_played_as_without_the_lock():
    deck, body = locked()
    rows = body.play(2.0, np.random.default_rng(3))
    assert np.all(rows[:, 1] == 1.0)
    assert deck.lock_state.state == "locked"


@pytest.mark.thorough
@settings(max_examples=6)
@given(st.floats(0.0, 1.0), st.sampled_from([1.0, 0.5, 2.0, -1.0]))
def test_held_at_any_phase_it_waits_there_and_goes_on_from_there(moment, tempo):
    deck, body = locked(tempo=tempo)
    body.play(moment * 1.6)
    body.held, where = body.at.copy(), deck.phase
    body.play(1.5)
    rows = body.play(1.0)
    assert np.abs(rows[:, 1]).max() < 0.05
    assert deck.lock_state.state == "waiting"
    assert abs(wrapped(deck.phase - where)) * 1.6 < 0.45 * max(1.0, abs(tempo))
    body.held = None
    waited = deck.phase
    rows = np.concatenate([rows, body.play(1.5)])
    assert deck.tempo == tempo
    assert deck.lock_state.state == "locked"
    assert wrapped(rows[220, 0] - waited) * tempo >= 0.0
    # The targets leave from where they stood: their speed changes no faster than the tempo may.
    speed = np.diff(rows[:, 2:], axis=0) / DT
    assert np.abs(speed).max() <= 1.02 * np.pi * abs(tempo) / 1.6
    assert np.abs(np.diff(rows[:, 1])).max() <= 5.0 * DT + 1e-9


def test_a_hand_takes_the_motion_back_and_ahead():
    deck, body = locked()
    for way in (-0.4, 0.3):
        start = deck.phase
        for share in np.linspace(0.0, 1.0, 300):
            angle = 2.0 * np.pi * (start + share * way)
            body.held = np.array([0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.3])
            body.play(DT)
        body.play(0.5)
        assert abs(wrapped(deck.phase - start - way)) < 0.15


def test_one_joint_that_is_held_is_enough():
    _, body = locked()
    body.play(0.5)
    body.held = np.array([body.at[0], np.nan, np.nan])
    body.play(1.5)
    assert np.abs(body.play(0.5)[:, 1]).max() < 0.1


def test_a_joint_beside_the_motion_stops_it_and_joints_that_are_not_measured_say_nothing():
    deck, body = locked()
    body.held = np.array([np.nan, np.nan, 0.7])
    body.play(1.0)
    assert deck.tempo == 0.0
    deck, body = locked()
    body.at = np.full(3, np.nan)
    assert np.all(body.play(1.0)[:, 1] == 1.0)


def test_paused_it_stands_and_without_joints_it_cannot_be_locked():
    deck, body = locked()
    deck.pause()
    body.play(1.0)
    assert deck.tempo == 0.0
    assert deck.lock_state.state == "searching"
    deck.set_tempo(0.5)
    assert deck.lock_state is not None
    with pytest.raises(MotiondeckError, match="no joints that are measured"):
        Wheel().lock("body")
