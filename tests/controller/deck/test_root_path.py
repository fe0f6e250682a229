"""The root's path: forward is x and left is y of the heading, which turns to the left."""

import numpy as np
import pytest

from controller.deck.performance import advance, at_origin
from controller.motion.rotations import rotate
from controller.motion.skeleton import Posture, walk_path

UPRIGHT = np.array([[1.0, 0.0, 0.0, 0.0]])


def walked(forward, left, turn_rate, seconds=1.0, dt=1e-3):
    posture = Posture(np.array(0.9), np.array([forward, left]), np.array(turn_rate), UPRIGHT)
    pose = at_origin(posture)
    for _ in range(round(seconds / dt)):
        pose = advance(pose, posture, dt)
    return pose


def test_a_step_to_the_left_goes_to_positive_y():
    np.testing.assert_allclose(walked(0.0, 0.5, 0.0).root_position, [0.0, 0.5, 0.9], atol=1e-9)


def test_after_a_quarter_turn_to_the_left_forward_is_y_and_left_is_minus_x():
    turning = Posture(np.array(0.9), np.zeros(2), np.array(np.pi / 2), UPRIGHT)
    pose = advance(at_origin(turning), turning, 1.0)
    pose = advance(pose, Posture(np.array(0.9), np.array([1.0, 0.25]), np.array(0.0), UPRIGHT), 1.0)
    np.testing.assert_allclose(pose.root_position, [-0.25, 1.0, 0.9], atol=1e-9)
    assert float(pose.heading) == pytest.approx(np.pi / 2)
    np.testing.assert_allclose(rotate(pose.rotation[0], np.array([1.0, 0.0, 0.0])), [0.0, 1.0, 0.0], atol=1e-9)


def test_a_sidestepping_body_that_turns_walks_a_circle():
    np.testing.assert_allclose(walked(0.0, 1.0, 2.0 * np.pi).root_position[:2], 0.0, atol=1e-2)
    half = walked(0.0, 1.0, np.pi).root_position[:2]  # half a circle of radius 1 / pi
    np.testing.assert_allclose(half, [-2.0 / np.pi, 0.0], atol=1e-2)


def test_a_whole_clip_is_placed_like_its_single_postures():
    rng = np.random.default_rng(5)
    frames, dt = 50, 0.01
    postures = Posture(
        rng.uniform(0.8, 1.0, frames),
        rng.normal(size=(frames, 2)),
        rng.normal(size=frames),
        np.tile(UPRIGHT, (frames, 1, 1)),
    )
    pose, placed = at_origin(Posture(np.array(1.0), np.zeros(2), np.array(0.0), UPRIGHT)), []
    for h, v, t, r in zip(postures.height, postures.velocity, postures.turn_rate, postures.rotation, strict=True):
        pose = advance(pose, Posture(np.array(h), v, np.array(t), r), dt)
        placed.append(pose.root_position)
    np.testing.assert_allclose(placed, walk_path(postures, dt).root_position, atol=1e-9)
