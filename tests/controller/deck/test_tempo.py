"""Tempo: what is commanded is followed smoothly, and a pause is a standstill whatever is commanded meanwhile."""

import pytest

from controller.deck.tempo import Paced
from controller.wire.messages.arguments import CommandError
from motiondeck_base.errors import MotiondeckError


def after(tempo, seconds, dt=0.01):
    for _ in range(round(seconds / dt)):
        tempo.advance_tempo(dt)
    return tempo.tempo


def test_a_change_takes_the_time_it_is_given():
    tempo = Paced()
    tempo.set_tempo(2.0, 4.0)
    assert after(tempo, 2.0) == pytest.approx(1.5)
    assert after(tempo, 2.5) == 2.0


@pytest.mark.parametrize("meanwhile", [(1.0, 10.0), (2.0, 30.0), (0.5, 0.0)])
def test_a_tempo_commanded_while_it_comes_to_a_pause_does_not_hold_the_pause_up(meanwhile):
    tempo = Paced()
    tempo.pause()
    after(tempo, 0.1)
    tempo.set_tempo(*meanwhile)
    assert after(tempo, 0.4) == 0.0
    assert tempo.commanded_tempo == meanwhile[0]


def test_a_ramp_commanded_in_a_pause_begins_after_it():
    tempo = Paced()
    tempo.pause()
    after(tempo, 1.0)
    tempo.set_tempo(2.0, 4.0)
    assert after(tempo, 1.0) == 0.0
    tempo.resume()
    assert after(tempo, 2.0) == pytest.approx(1.0)


def test_a_pause_forgets_how_slowly_a_tempo_was_to_change():
    tempo = Paced()
    tempo.set_tempo(2.0, 30.0)
    after(tempo, 1.0)
    tempo.pause()
    after(tempo, 1.0)
    tempo.resume()
    assert after(tempo, 1.0) == 2.0


@pytest.mark.parametrize(("factor", "over"), [(-3.1, 0.0), (3.5, 0.0), (float("nan"), 0.0), (1.0, -1.0)])
def test_a_tempo_out_of_range_is_refused(factor, over):
    tempo = Paced()
    with pytest.raises(MotiondeckError, match="must be a number from"):
        tempo.set_tempo(factor, over)
    assert tempo.commanded_tempo == 1.0


def test_a_step_in_a_pause_goes_on_for_its_time_and_stands_still_again():
    tempo = Paced()
    tempo.set_tempo(-0.5, over=0.0)
    with pytest.raises(MotiondeckError, match="pause first"):
        tempo.step_on(0.0)
    tempo.pause()
    for _ in range(200):
        tempo.advance_tempo(0.01)
    for seconds, updates in ((0.0, 1), (0.1, 10)):
        tempo.step_on(seconds)
        assert [tempo.advance_tempo(0.01) for _ in range(updates + 3)] == [-0.5] * updates + [0.0] * 3
    tempo.step_on(1.0)
    tempo.resume()
    assert abs(tempo.advance_tempo(0.01)) < 0.1
    with pytest.raises(CommandError):
        tempo.step_on(1.5)
