"""Test that the joints of a robot and the path of its root are encoded and followed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.motion.encodings.robot_joints import ROOT, RobotJoints, RootPath, quaternion
from controller.motion.rotations import from_rotation_vector, normalise, rotate
from controller.motion.skeleton import Pose, walk_path
from motiondeck_base.errors import FileFormatError

PARTS = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1)


@given(PARTS)
def test_two_axes_give_their_rotation_back(parts):
    turn = normalise(np.array(parts))
    found = np.array(quaternion(*rotate(turn, np.array([2.0, 0, 0])), *rotate(turn, np.array([0.3, 0.5, 0]))))
    assert abs(found @ turn) == pytest.approx(1.0, abs=1e-9)


def test_axes_of_no_length_give_finite_numbers():
    assert np.isfinite(quaternion(0, 0, 0, 0, 0, 0)).all()


def walked(seed, frames=121, rate=120.0):
    """A robot of two joints that walks a curve and turns over."""
    rng, t = np.random.default_rng(seed), np.arange(frames) / rate
    angles = np.sin(2.0 * np.pi * np.outer(t, [1.0, 2.0]) + rng.uniform(0.0, 6.0, 2))
    heading = 0.7 * t + 0.2 * np.sin(3.0 * t)
    tilt = from_rotation_vector(np.outer(t, rng.normal(size=3) * 4.0))
    place = np.column_stack([np.sin(t), t**2, 0.8 + 0.1 * np.cos(t)])
    return angles, np.column_stack([place, tilt]), heading, rate


@pytest.mark.parametrize("tempo", [1.0, 0.5])
def test_the_root_goes_its_way_at_any_tempo(tempo):
    angles, root, heading, rate = walked(3)
    encoding = RobotJoints.for_joints(["a", "b"])
    channels = encoding.encode_path(angles, root, heading, rate)
    times = np.arange(0.0, len(channels) - 1.0, tempo)
    between = np.array([np.interp(times, np.arange(len(channels)), column) for column in channels.T]).T
    posture = encoding.decode(between)
    posture.velocity *= tempo
    pose, path = walk_path(posture, 1.0 / rate), RootPath()
    found = np.array([path(Pose(*one)) for one in zip(pose.root_position, pose.heading, pose.rotation, strict=True)])
    moved, turned = found[-1, :2] - found[0, :2], root[-2, :2] - root[1, :2]
    assert np.linalg.norm(moved) == pytest.approx(np.linalg.norm(turned), rel=0.02)
    assert found[-1, 2] == pytest.approx(root[-2, 2], abs=1e-3)
    assert path.heading == pytest.approx(heading[-2] - heading[1], abs=0.02)
    last = rotate(found[-1, 3:], np.array([0.0, 0.0, 1.0]))[2]  # how upright it is does not depend on the heading
    assert last == pytest.approx(rotate(root[-2, 3:], np.array([0.0, 0.0, 1.0]))[2], abs=0.05)


def test_a_root_that_stands_stays():
    encoding, path = RobotJoints.for_joints(["a"]), RootPath()
    angles, heading = np.zeros((5, 1)), np.full(5, 0.4)
    root = np.tile([1.0, 2.0, 0.5, 1.0, 0.0, 0.0, 0.0], (5, 1))
    pose = walk_path(encoding.decode(encoding.encode_path(angles, root, heading, 100.0)), 0.01)
    for one in zip(pose.root_position, pose.heading, pose.rotation, strict=True):
        assert path(Pose(*one))[:3] == pytest.approx([0.0, 0.0, 0.5])


def test_joints_without_a_root_are_refused():
    info = RobotJoints.for_joints(["a"]).skeleton_info()
    assert RobotJoints.restore(info).skeleton.robot_joints == ("a",)
    info.bones.remove(ROOT[0])
    with pytest.raises(FileFormatError, match="root turn"):
        RobotJoints.restore(info)
