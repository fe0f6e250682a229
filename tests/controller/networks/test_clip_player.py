"""The clip player: recorded frames, forwards, backwards, and from any phase."""

import numpy as np
import pytest

import synthetic
from controller.learning.measures.self_test import run_free
from controller.networks.clip.network import ClipPlayer


@pytest.fixture
def player():
    return ClipPlayer(synthetic.references(), synthetic.LOOPS)


def stepped(step, channels):
    out = np.empty(channels)
    step(out)
    return out


def test_a_loop_goes_round_as_it_was_recorded(player):
    assert np.abs(run_free(player, "march", 96) - np.roll(synthetic.march(), -1, axis=0)).max() < 1e-6


def test_it_goes_back_the_way_it_came(player):
    player.cue("march", 1)
    frames = synthetic.march()
    assert stepped(player.retreat, player.channels) == pytest.approx(frames[0], abs=1e-6)
    assert stepped(player.retreat, player.channels) == pytest.approx(frames[-1], abs=1e-6)


def test_a_one_shot_holds_its_ends(player):
    frames = synthetic.references()["bow"]
    player.seek("bow", 1.0)
    assert player.phase == 1.0
    assert stepped(player.advance, player.channels) == pytest.approx(frames[-1], abs=1e-6)
    player.seek("bow", 0.0)
    assert stepped(player.retreat, player.channels) == pytest.approx(frames[0], abs=1e-6)


def test_the_deck_sees_a_network_with_a_phase(player):
    assert player.as_phase_network is player


def test_it_knows_its_phase_and_goes_on_from_a_snapshot(player):
    player.seek("wave", 0.25)
    assert player.phase == pytest.approx(0.25)
    before = player.snapshot()
    frame = stepped(player.advance, player.channels)
    twin = player.twin()
    twin.restore(before)
    assert np.array_equal(stepped(twin.advance, player.channels), frame)
