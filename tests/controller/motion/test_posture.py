import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from controller.motion.rotations import IDENTITY, rotate
from controller.motion.skeleton import Posture, walk_path


def still(frames, **changes):
    fields = {
        "height": np.ones(frames),
        "velocity": np.zeros((frames, 2)),
        "turn_rate": np.zeros(frames),
        "rotation": np.tile(IDENTITY, (frames, 3, 1)),
    }
    return Posture(**(fields | changes))


def test_walking_straight_covers_velocity_times_time():
    pose = walk_path(still(120, velocity=np.tile([1.5, 0.0], (120, 1))), dt=1 / 120)
    assert np.allclose(pose.root_position[-1], [1.5, 0.0, 1.0])
    assert np.allclose(pose.heading, 0.0)


def test_speed_scales_the_path_and_not_the_height():
    posture = still(60, velocity=np.tile([1.0, 0.5], (60, 1)), turn_rate=np.full(60, 0.0))
    slow, fast = walk_path(posture, 0.01), walk_path(posture, 0.01, speed=2.0)
    assert np.allclose(fast.root_position[:, :2], 2.0 * slow.root_position[:, :2])
    assert np.allclose(fast.root_position[:, 2], slow.root_position[:, 2])


@given(st.floats(0.3, 3.0), st.floats(-3.0, 3.0).filter(lambda turn: abs(turn) > 0.2))
def test_walking_while_turning_goes_round_a_circle(velocity, turn_rate):
    dt = 0.001
    frames = int(2.0 * np.pi / abs(turn_rate) / dt)
    pose = walk_path(
        still(frames, velocity=np.tile([velocity, 0.0], (frames, 1)), turn_rate=np.full(frames, turn_rate)), dt
    )
    centre = np.array([0.0, velocity / turn_rate])
    radius = np.linalg.norm(pose.root_position[:, :2] - centre, axis=1)
    assert np.allclose(radius, velocity / abs(turn_rate), atol=3 * velocity * dt)


def test_a_quarter_turn_makes_left_of_forward():
    pose = walk_path(
        still(2, velocity=np.array([[0.0, 0.0], [1.0, 0.0]]), turn_rate=np.array([np.pi / 2, 0.0])), dt=1.0
    )
    assert np.allclose(pose.root_position[-1, :2], [0.0, 1.0])
    assert np.allclose(rotate(pose.rotation[-1, 0], np.array([1.0, 0.0, 0.0])), [0.0, 1.0, 0.0])
    assert np.allclose(pose.heading, np.pi / 2)
