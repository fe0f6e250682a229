"""A locked loop misses ticks: it sees at once how far behind it is, and is in step again soon, without a leap."""

import numpy as np
import pytest

from controller.deck.interfaces import JointLimits
from controller.deck.locks.phase_lock import wrapped
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.wire.leader_link import Sighting
from wheel import ROUND, Wheel

PERIOD = 0.01
FASTEST = 0.5 * 2.0 * np.pi / ROUND  # rad/s of the wheel's joints at tempo 1


def phase_at(time, ahead=0.0):
    """Of what is followed: a show, or another deck."""
    return (ahead + time / ROUND) % 1.0


class Play:
    """A deck whose ticks are due by a clock that began long ago, and that sees a show every 50 ms."""

    def __init__(self, phase, *, period=PERIOD, source="deck"):
        self.wheel, self.period, self.now, self.seen = Wheel(phase), period, 1000.0, 0.0
        self.wheel.due = lambda: self.now
        self.wheel.leader = self._look
        if source == "deck":
            self.wheel.lock("deck")
        self.errors, self.tempos, self.targets = [], [], []

    def _look(self, _):
        """An answer that came in the middle between ticks."""
        if self.now < self.seen + 0.05:
            return None
        self.seen, at = self.now, self.now - 0.4 * self.period
        return Sighting(at, phase_at(at), 1.0 / ROUND)

    def play(self, seconds, beats=()):
        """Plays on; errors are those at the times when ticks were due, s."""
        waiting = [beat for beat in beats if beat >= self.now]
        for _ in range(round(seconds / self.period)):
            self.now += self.period
            while waiting and waiting[0] <= self.now:
                self.wheel.beat(self.now - waiting.pop(0))
            self.wheel.update(self.period)
            self.errors.append(wrapped(phase_at(self.now) - self.wheel.phase) * ROUND)
            self.tempos.append(self.wheel.tempo)
            self.targets.append(self.wheel.targets)

    def miss(self, ticks):
        """The loop stands still for so many ticks."""
        self.now += ticks * self.period


def in_step_after(errors, within=0.01):
    """How many ticks there are until all errors are within 10 ms."""
    return int(np.flatnonzero(np.abs(errors) > within)[-1]) + 1


@pytest.mark.parametrize(("missed", "seconds"), [(2, 0.2), (7, 0.5), (17, 0.8)])
def test_it_is_in_step_again_soon_within_the_limits_of_speed(missed, seconds):
    stage = Play(phase_at(1000.0))
    stage.play(2.0)
    assert np.abs(stage.errors[-50:]).max() < 1e-4
    began = len(stage.errors)
    stage.miss(missed)
    stage.play(2.0)
    errors, tempos = np.array(stage.errors[began:]), np.array(stage.tempos[began - 1 :])
    assert errors[0] == pytest.approx(missed * PERIOD, abs=0.002)
    assert in_step_after(errors) * PERIOD < seconds
    assert errors.min() > -0.003
    assert np.abs(np.diff(tempos)).max() <= 2.5 * PERIOD + 1e-9
    assert tempos.max() < 1.8
    limits = JointLimits(*(np.full(3, value) for value in (-1.0, 1.0, 2.0 * FASTEST, 500.0, 50_000.0)))
    envelope = SafetyEnvelope(limits, PERIOD)
    envelope.start(stage.targets[0])
    shown = np.array([envelope(targets).copy() for targets in stage.targets])
    moved = np.abs(np.diff(shown[began:], axis=0)).max() / PERIOD
    assert moved < 1.8 * FASTEST
    np.testing.assert_allclose(shown[began:], stage.targets[began:], atol=1e-9)


def test_a_beat_is_not_mistaken_for_a_later_one_when_ticks_were_missed():
    beats = 1000.0 + ROUND / 2.0 * np.arange(40)
    stage = Play(phase_at(1000.0), source="beat")
    stage.wheel.lock("beat", steps=2)
    stage.play(6.0, beats)
    assert np.abs(stage.errors[-50:]).max() < 0.001
    stage.miss(15)
    stage.play(1.2, beats)
    assert np.abs(stage.errors[-20:]).max() < 0.01


def test_decks_of_different_rates_are_in_step_to_a_millisecond():
    for rate in (50.0, 100.0, 200.0, 1000.0):
        stage = Play(phase_at(1000.3), period=1.0 / rate)
        stage.play(4.0)
        assert np.abs(stage.errors[-20:]).max() < 0.001
