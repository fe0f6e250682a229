"""The cubic between frames, as a player follows it."""

import numpy as np
import pytest

from controller.motion.clip import between_frames


def test_a_parabola_is_followed_exactly():
    frames = np.arange(8.0)[:, None] ** 2
    at = np.linspace(1.0, 6.0, 23)
    assert between_frames(frames, at)[:, 0] == pytest.approx(at**2)


def test_halfway_between_frames_the_outer_ones_count_a_sixteenth():
    assert between_frames(np.eye(4), np.array([1.5]))[0] * 16 == pytest.approx([-1, 9, 9, -1])


def test_beyond_the_ends_frames_are_repeated():
    frames = np.array([[1.0, 5.0], [2.0, 7.0]])
    assert between_frames(frames, np.array([0.0, 1.0, 2.5]))[[0, 1, 2]] == pytest.approx(frames[[0, 1, 1]])
