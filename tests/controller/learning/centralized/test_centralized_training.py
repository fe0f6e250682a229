"""Motions taught to a centralized network come back, round after round, and once only where they happen once."""

import numpy as np
import pytest

import synthetic
from controller.learning.centralized.motion_training import train_centralized
from controller.learning.trainers.centralized import CentralizedRecipe
from motiondeck_base.errors import MotiondeckError


@pytest.mark.parametrize("name", ["march", "wave"])
@pytest.mark.parametrize("centers", [1, 2, 3])
def test_a_loop_comes_back_and_closes(name, centers):
    frames = synthetic.MOTIONS[name]()
    part = train_centralized(frames, synthetic.RATE, loop=True, centers=centers, satellites=16, iterations=60)
    time = np.arange(len(frames)) / synthetic.RATE
    assert np.abs(part.at(time) - frames).max() < 0.02
    assert np.allclose(part.at(time + 10 * part.seconds), part.at(time), atol=1e-9)
    turns = part.frequency * part.seconds / (2 * np.pi)
    assert np.allclose(turns, np.round(turns))
    assert part.largest_weight < 50


def test_a_motion_that_happens_once_ends_where_it_was_taught_to():
    frames = synthetic.bow()
    part = train_centralized(frames, synthetic.RATE, loop=False, satellites=20, iterations=60)
    assert np.abs(part.at(np.arange(len(frames)) / synthetic.RATE) - frames).max() < 0.05
    assert np.allclose(part.at(np.array([99.0])), part.at(np.array([part.seconds])))


def test_the_same_seed_gives_the_same_network():
    one, other = (train_centralized(synthetic.wave(), 120.0, loop=True, satellites=9, iterations=20) for _ in range(2))
    assert np.array_equal(one.weights, other.weights)


def test_more_motions_than_can_be_switched_between_are_refused_at_once():
    lessons, normalisation = synthetic.lessons()
    with pytest.raises(MotiondeckError, match=r"201 motions in one centralized network.*1 to 200.*several libraries"):
        synthetic.trained(CentralizedRecipe(), 67 * lessons, normalisation)


def test_what_cannot_be_taught_is_refused():
    frames = synthetic.wave()
    with pytest.raises(MotiondeckError, match="120 satellites"):
        train_centralized(frames, 120.0, loop=True, satellites=120)
    with pytest.raises(MotiondeckError, match="at least one"):
        train_centralized(frames, 120.0, loop=True, satellites=0)
    with pytest.raises(MotiondeckError, match="at least one"):
        train_centralized(frames, 120.0, loop=True, centers=0)


@pytest.mark.parametrize("loop", [True, False])
def test_a_pose_that_is_held_comes_back(loop):
    held = np.tile([0.5, 1.0, -0.25], (30, 1))
    part = train_centralized(held, 120.0, loop=loop, satellites=4, iterations=10)
    assert np.allclose(part.at(np.array([0.0, 0.1, 5.0])), held[:3], rtol=0.0, atol=1e-12)
