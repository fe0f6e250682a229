"""A frame player of a phase-driven network: sent to a phase, held, played at any tempo and backwards."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import synthetic
from controller.deck.tracks.frame_player import FramePlayer
from motiondeck_base.errors import MotiondeckError

DT = 1.0 / synthetic.RATE


@pytest.fixture(scope="module")
def network():
    return synthetic.small_phase_network()


@pytest.fixture
def player(network):
    return FramePlayer(network.twin(), synthetic.RATE)


def at(player, motion, phase):
    """The channels at a phase."""
    player.cue(motion, phase)
    return player.step(0.0).copy()


@given(st.floats(0.0, 0.99), st.sampled_from(["march", "wave"]))
@settings(max_examples=30, deadline=None)
def test_a_loop_is_entered_at_any_phase(network, phase, motion):
    player = FramePlayer(network.twin(), synthetic.RATE)
    taught = synthetic.MOTIONS[motion]()
    frame = round(phase * len(taught)) % len(taught)
    assert np.abs(at(player, motion, phase) - taught[frame]).max() < 0.02
    assert player.phase == pytest.approx(frame / len(taught))


@pytest.mark.parametrize("tempo", [0.0, 0.3, 1.0, 3.0, -0.5, -1.0, -2.7])
def test_the_phase_goes_on_with_the_tempo(player, tempo):
    player.cue("march", 0.25)
    for _ in range(60):
        shown = player.step(tempo * DT)
    expected = (0.25 + 60 * tempo / 96) % 1.0
    assert player.phase == pytest.approx(expected, abs=1e-9)
    assert np.abs(shown - at(player, "march", expected)).max() < 0.1  # to the nearest frame


def test_what_is_played_back_is_what_was_played(player):
    player.cue("wave", 0.1)
    there = [player.step(0.7 * DT).copy() for _ in range(80)]
    back = [player.step(-0.7 * DT).copy() for _ in range(79)]
    assert np.abs(np.array(back) - np.array(there[-2::-1])).max() < 1e-3


@given(st.lists(st.floats(-3.0, 3.0), min_size=5, max_size=60))
@settings(max_examples=30, deadline=None)
def test_no_tempo_makes_it_jump(network, tempi):
    player = FramePlayer(network.twin(), synthetic.RATE)
    fastest = np.abs(np.diff(synthetic.march(), axis=0)).max()
    player.cue("march", 0.5)
    before, place = player.step(0.0).copy(), player.phase
    for tempo in tempi:
        after = player.step(tempo * DT).copy()
        assert np.abs(after - before).max() <= 1.2 * fastest * abs(tempo) + 5e-3
        before, place = after, place + tempo / 96
        assert abs((player.phase - place + 0.5) % 1.0 - 0.5) < 1e-6


def test_a_one_shot_goes_to_its_end_and_back_to_its_beginning(player):
    bow = synthetic.bow()
    player.cue("bow", 0.0)
    for _ in range(len(bow) + 50):
        shown = player.step(DT)
    assert player.phase == 1.0
    assert np.abs(shown - bow[-1]).max() < 0.02
    # However long the end was held, it leaves it at once.
    step = np.abs(player.step(-DT) - shown.copy()).max()
    for _ in range(5):
        player.step(-DT)
    assert player.phase < 1.0
    assert step < 0.02
    for _ in range(len(bow) + 50):
        shown = player.step(-DT)
    assert player.phase == 0.0
    assert np.abs(shown - bow[0]).max() < 0.02


def test_a_network_that_runs_by_itself_is_not_played_backwards():
    player = FramePlayer(synthetic.small_network(), synthetic.RATE)
    for wrong in (lambda: player.step(-DT), lambda: player.phase):
        with pytest.raises(MotiondeckError, match="it has no phase"):
            wrong()
