import numpy as np
import pytest

import synthetic
from controller.deck.tracks.frame_player import FramePlayer
from controller.networks.clip.network import ClipPlayer


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


class Polynomial:
    """A network whose frames lie on a given curve of the frame's number."""

    as_phase_network = None

    motions = ("curve",)
    channels = 1

    def __init__(self, curve):
        self.curve, self.frame = curve, 0

    def anchors(self, motion):
        return np.array([[self.curve(0.0)]])

    def cue(self, motion, anchor):
        self.frame = 0

    def advance(self, out):
        self.frame += 1
        out[:] = self.curve(float(self.frame))


@pytest.mark.parametrize("curve", [lambda t: 3.0 - 2.0 * t, lambda t: 1.0 + t - 0.7 * t * t])
def test_a_line_and_a_parabola_are_played_exactly_between_frames(curve):
    """Catmull-Rom reproduces polynomials up to the second degree."""
    player = FramePlayer(Polynomial(curve), rate=1.0)
    played = play(player, 0.2, 40)[:, 0]
    np.testing.assert_allclose(played, [curve(1.0 + 0.2 * k) for k in range(1, 41)], rtol=1e-9)


def test_halfway_between_frames_the_outer_ones_count_a_sixteenth():
    """Catmull and Rom 1974: the weights at u = 1/2 are (-1, 9, 9, -1) / 16."""
    for spike, weight in enumerate((-1 / 16, 9 / 16, 9 / 16, -1 / 16)):
        player = FramePlayer(Polynomial(lambda t, spike=spike: float(t == spike)), rate=1.0)
        assert player.step(0.5)[0] == pytest.approx(weight)


@pytest.mark.parametrize("way_in", ["phase", "anchor"])
@pytest.mark.parametrize("motion", ["bow", "march"])
def test_a_motion_with_a_phase_starts_in_its_first_frame(motion, way_in):
    network = synthetic.small_phase_network()
    player = FramePlayer(network, 120.0)
    if way_in == "phase":
        player.cue(motion)
    else:
        player.cue_anchor(motion, 0)
    played = np.array([player.step(0.0).copy(), *play(player, 1 / 120, 39)])
    np.testing.assert_allclose(played, network.settled(motion)[:40], atol=1e-3)
    steps = np.abs(np.diff(played, axis=0)).max(1)
    assert steps[0] < 2.0 * steps[1:].max()


def test_a_one_shot_is_turned_round_at_its_start():
    player = FramePlayer(synthetic.small_phase_network(), 120.0)
    player.cue("bow")
    first = player.step(0.0).copy()
    play(player, 1 / 120, 3)
    back = play(player, -1 / 120, 8)
    np.testing.assert_allclose(back[-1], first, atol=1e-3)
    assert player.phase == 0.0


@pytest.mark.parametrize("begin", [0, 1, 2, 18, 19, 20])
@pytest.mark.parametrize("backs", [(-1,) * 30 + (1,) * 30, (1,) * 30 + (-1,) * 30, (-1, 1, 1, -1, -1, -1, 1, 1) * 3])
def test_a_one_shot_that_turns_round_at_an_end_never_jumps(begin, backs):
    player = FramePlayer(ClipPlayer({"line": np.arange(21.0)[:, None]}, {"line": False}), 100.0)
    player.cue("line", begin / 20)
    played = np.array([player.step(back * 0.004)[0] for back in backs])
    assert np.abs(np.diff(played)).max() < 0.5  # 0.4 frames a step
    assert np.ptp(played) > 0.3
