"""A clip that is written comes back when it is read."""

import csv

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.motion.clip import Clip
from controller.motion.formats.bvh import read_bvh
from controller.motion.formats.writing import write_clip
from controller.motion.rotations import about, conjugate, multiply, to_rotation_vector
from motiondeck_base.errors import FileFormatError
from simulated_bodies import human, random_pose


def moving(seed, frames=6):
    body, random = human(), np.random.default_rng(seed)
    poses = [random_pose(body, random) for _ in range(frames)]
    position = np.array([pose.root_position for pose in poses])
    return Clip("moving", body, 60.0, position, np.array([pose.rotation for pose in poses]))


def check_same(clip, back):
    assert back.skeleton.bones == clip.skeleton.bones
    assert back.rate == clip.rate
    np.testing.assert_allclose(back.skeleton.rest_direction, clip.skeleton.rest_direction, atol=1e-6)
    np.testing.assert_allclose(back.joints(), clip.joints(), atol=1e-6)
    off = to_rotation_vector(multiply(conjugate(clip.rotation), back.rotation))
    assert np.abs(off).max() < 1e-6


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_bvh_comes_back(tmp_path, seed):
    clip = moving(seed)
    write_clip(clip, tmp_path / "moving.bvh")
    check_same(clip, read_bvh(tmp_path / "moving.bvh"))


@pytest.mark.parametrize("turn", [0.5, -0.5])
def test_bvh_comes_back_where_two_of_its_angles_turn_about_one_axis(tmp_path, turn):
    clip = moving(0)
    # Our z is the file's y, the middle one of a bone's angles; our y is its x, the middle one of the root's.
    clip.rotation[:, 0] = about(np.array([0.0, 1.0, 0.0]), np.full(6, turn * np.pi))
    quarter = about(np.array([0.0, 0.0, 1.0]), np.full(6, turn * np.pi))
    clip.rotation[:, 1:] = multiply(multiply(clip.rotation[:, 0], quarter), about(np.array([1.0, 0, 0]), 0.3))[:, None]
    write_clip(clip, tmp_path / "moving.BVH")
    check_same(clip, read_bvh(tmp_path / "moving.BVH"))


def test_angles_run_on_past_a_half_turn(tmp_path):
    clip = moving(0, 40)
    clip.rotation[:] = about(np.array([0.0, 0.0, 1.0]), np.linspace(0.0, 9.0, 40))[:, None]
    write_clip(clip, tmp_path / "turning.bvh")
    rows = [line.split() for line in (tmp_path / "turning.bvh").read_text().splitlines()[-40:]]
    angles = np.array(rows, dtype=float)[:, 3:]
    assert np.abs(np.diff(angles, axis=0)).max() < 20.0


def test_csv_holds_every_joint(tmp_path):
    clip = moving(3)
    write_clip(clip, tmp_path / "moving.csv")
    with (tmp_path / "moving.csv").open() as file:
        head, *rows = csv.reader(file)
    assert head[:5] == ["time_s", "root.x", "root.y", "root.z", "rhip.x"]
    table = np.array(rows, dtype=float)
    np.testing.assert_allclose(table[:, 0], np.arange(6) / 60.0, atol=1e-6)
    np.testing.assert_allclose(table[:, 1:], clip.joints().reshape(6, -1), atol=1e-6)


@pytest.mark.parametrize(("name", "problem"), [("m.fbx", r"\.bvh or \.csv"), ("nowhere/m.bvh", "cannot be written")])
def test_what_cannot_be_written_is_said_and_leaves_nothing(tmp_path, name, problem):
    with pytest.raises(FileFormatError, match=problem):
        write_clip(moving(0), tmp_path / name)
    assert list(tmp_path.iterdir()) == []
