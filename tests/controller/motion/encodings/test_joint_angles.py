"""A rig's joints as a body: angles out and back, the clip file, and what a damaged one says."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from controller.deck.joins.transition import Fade, difference, displaced
from controller.motion.canonical.canonical_body import carried
from controller.motion.encodings.encoding import encoding_of
from controller.motion.encodings.joint_angles import JointAngles, JointBody, JointRetargeter, angles_in, angles_of
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.formats.reading import read_clip
from controller.motion.formats.taught_clip import read_taught_clip, save_taught_clip, taught_clip
from controller.motion.skeleton import walk_path
from motiondeck_base.errors import FileFormatError, UnknownNameError

JOINTS = ("pan", "tilt", "grip")
angles = hnp.arrays(np.float64, st.tuples(st.integers(1, 5), st.just(3)), elements=st.floats(-12.5, 12.5))


@given(angles)
def test_angles_become_a_body_and_angles_again(values):
    encoding = JointAngles(JointBody.of(JOINTS))
    clip = taught_clip("wave", JOINTS, 100.0, values)
    assert encoding_of(clip.skeleton).encode(clip) == pytest.approx(values, abs=1e-12)
    posture = encoding.decode(values)
    assert angles_of(posture.rotation[:, 1:]) == pytest.approx(values, abs=1e-12)
    retarget = JointRetargeter(encoding.skeleton, ("tilt", "other", "grip", "pan"), np.full(4, 0.5))
    pose = walk_path(posture, 0.01)
    assert retarget(pose_at(pose, 0)).tolist() == pytest.approx([values[0, 1], 0.5, values[0, 2], values[0, 0]])


def pose_at(pose, index):
    return type(pose)(pose.root_position[index], pose.heading[index], pose.rotation[index])


def test_a_small_difference_reads_in_milliradians():
    encoding = JointAngles(JointBody.of(JOINTS))
    at = joint_features(encoding, np.array([[1.0, -2.0, 3.0], [1.01, -2.0, 3.0]]))
    assert np.linalg.norm(at[1] - at[0]) == pytest.approx(10.0, rel=1e-3)


def test_a_fade_leads_back_the_way_it_came_and_never_through_the_ends_of_a_turn():
    encoding = JointAngles(JointBody.of(("pan",)))
    still = [encoding.decode(np.array([angle])) for angle in (3.0, -3.0)]

    fade = Fade(0.5, 0.5, *difference((still[0], still[0]), (still[1], still[1]), 0.01))
    moments = np.linspace(0.0, fade.duration, 50)
    way = [angles_of(displaced(still[1], fade.left(t), 0.0).rotation[1:])[0] for t in moments]
    assert way[0] == pytest.approx(3.0)
    assert way[-1] == pytest.approx(-3.0)
    assert (np.diff(way) <= 1e-9).all()


def test_a_clip_is_read_as_it_was_written(tmp_path):
    path = tmp_path / "wave.clip"
    values = np.random.default_rng(0).uniform(-3.0, 3.0, (60, 3))
    save_taught_clip(taught_clip("wave", JOINTS, 50.0, values, "rig.toml"), path)
    clip = read_clip(path)
    assert (clip.name, clip.skeleton.bones, clip.rate, clip.source) == ("wave", JOINTS, 50.0, "rig.toml")
    assert angles_of(clip.rotation[:, 1:]) == pytest.approx(values, abs=1e-12)
    assert carried(clip, read_taught_clip(path).skeleton).duration == pytest.approx(1.2)


@pytest.mark.parametrize(
    ("joints", "values", "said"),
    [
        (JOINTS, np.zeros((4, 2)), "for 3 joints"),
        (JOINTS, np.full((4, 3), np.nan), "not finite"),
        (JOINTS, np.full((4, 3), 13.0), "beyond two turns"),
        (("pan", "pan", "grip"), np.zeros((4, 3)), "two bones are called 'pan'"),
        (JOINTS, np.zeros((0, 3)), "do not hold frames"),
    ],
)
def test_what_is_no_clip_is_refused(joints, values, said):
    with pytest.raises(FileFormatError, match=said):
        taught_clip("wave", joints, 100.0, values)


def test_a_damaged_file_is_refused_by_its_name(tmp_path):
    path = tmp_path / "wave.clip"
    save_taught_clip(taught_clip("wave", JOINTS, 50.0, np.zeros((9, 3))), path)
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(FileFormatError, match=r"wave\.clip: not a safetensors file"):
        read_clip(path)
    with pytest.raises(FileFormatError, match="rig teach"):
        read_clip(tmp_path / "none.clip")


def test_a_robot_without_the_joint_is_refused():
    with pytest.raises(UnknownNameError, match="'grip'"):
        JointRetargeter(JointBody.of(JOINTS), ("pan", "tilt"), np.zeros(2))


def test_a_posture_tells_angles_as_they_were_and_rotations_that_fit_them():
    rng = np.random.default_rng(3)
    body = JointBody.of(["pan", "tilt", "jaw"])
    for angles in rng.uniform(-2.0 * np.pi, 2.0 * np.pi, (20, 3)):
        posture = JointAngles(body).decode(angles)
        pose = posture.at(np.array([0.1, 0.2, 1.0]))
        assert angles_in(pose).tolist() == angles.tolist()
        several = JointAngles(body).decode(np.array([angles]))
        assert np.array_equal(pose.rotation, several.rotation[0])
        assert np.array_equal(posture.rotation, pose.rotation)
        assert np.allclose(angles_of(pose.rotation[1:]), angles, atol=1e-12)
        other = replace(posture, rotation=JointAngles(body).decode(-angles).rotation)
        assert np.allclose(angles_in(other.at(pose.root_position)), -angles, atol=1e-12)
        with pytest.raises(AttributeError):
            _ = pose.nothing
