import numpy as np
import pytest

import synthetic
from controller.deck.frame_player import FramePlayer


@pytest.fixture(scope="module")
def network():
    return synthetic.small_network()


def play(player, dt, count):
    return np.array([player.step(dt).copy() for _ in range(count)])


def test_at_the_rate_of_the_network_its_own_frames_are_played(network):
    player = FramePlayer(network, 120.0)
    player.cue("march")
    played = play(player, 1 / 120, 40)
    network.cue("march", 0)
    frames = np.empty((42, network.channels))
    for frame in frames:
        network.advance(frame)
    np.testing.assert_allclose(played[:38], frames[1:39], atol=1e-6)


def test_a_finer_step_passes_through_the_same_motion(network):
    player = FramePlayer(network, 120.0)
    player.cue("march")
    coarse = play(player, 1 / 120, 40)
    player.cue("march")
    fine = play(player, 1 / 480, 160)
    np.testing.assert_allclose(fine[3::4], coarse, atol=1e-6)


def test_nothing_jumps_between_frames(network):
    player = FramePlayer(network, 120.0)
    player.cue("wave")
    steps = np.abs(np.diff(play(player, 1 / 1000, 2000), axis=0)).max(1)
    assert steps.max() < 4.0 * np.median(steps) + 1e-3


def test_a_step_of_no_time_stays_where_it_is(network):
    player = FramePlayer(network, 120.0)
    player.cue("march")
    play(player, 0.003, 9)
    assert np.array_equal(player.step(0.0).copy(), player.step(0.0).copy())


def test_two_runs_from_one_snapshot_are_identical(network):
    player = FramePlayer(network, 120.0)
    player.cue("bow", 0.1)
    play(player, 0.004, 11)
    kept = player.snapshot()
    first = play(player, 0.004, 50)
    player.cue("wave")
    player.restore(kept)
    assert np.array_equal(first, play(player, 0.004, 50))
    assert player.motion == "bow"
