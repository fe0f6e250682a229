"""Tests of the benchmark that retargets many clips: how it cuts them, and that what it reads back is judged."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.robots.training_files import read_back, write_clips
from controller.motion.clip import Clip
from controller.motion.formats.reading import read_clip
from controller.motion.formats.writing import write_clip
from motiondeck_base.jobs import Jobs
from sim.robots.retarget_files import retarget_files
from simulated_bodies import human, smooth_poses
from small_robots import calibrated, humanoid


@pytest.fixture(scope="module")
def swing():
    poses = smooth_poses(human(), np.random.default_rng(3), 20, reach=0.3)
    path = np.array([pose.root_position for pose in poses])
    return Clip("swing", human(), 50.0, path, np.array([pose.rotation for pose in poses]))


def test_the_longest_clips_are_cut_in_halves_and_nothing_is_lost(tmp_path, swing):
    (tmp_path / "data").mkdir()
    write_clip(swing, tmp_path / "data" / "long.bvh")
    write_clip(
        replace(swing, root_position=swing.root_position[:8], rotation=swing.rotation[:8]),
        tmp_path / "data" / "short.bvh",
    )
    assert write_clips(tmp_path / "data", tmp_path / "clips", 4) == pytest.approx(28 / 50)
    counts = [len(read_clip(path)) for path in sorted((tmp_path / "clips").iterdir())]
    assert sorted(counts) == [5, 5, 8, 10]


def test_a_file_is_where_mujoco_has_the_robot_and_one_that_is_not_is_noticed(tmp_path, swing):
    model = tmp_path / "small.xml"
    model.write_text(humanoid())
    (tmp_path / "small.toml").write_text(calibrated(model).to_toml(tmp_path))
    write_clip(swing, tmp_path / "swing.bvh")
    out = tmp_path / "motions"
    (row,) = retarget_files(tmp_path / "small.toml", [tmp_path / "swing.bvh"], out, "mjlab", jobs=Jobs(1))
    assert not row.error
    right = read_back(model, out)
    assert right["frames_read"] == 20
    assert right["farthest_m"] < 1e-6
    assert right["turned_rad"] < 1e-6
    (path,) = out.rglob("*.npz")
    arrays = dict(np.load(path))
    arrays["body_pos_w"][7, 3, 1] += 0.001
    arrays["body_quat_w"][9, 2] *= [-1.0, -1.0, -1.0, -1.0]  # the same rotation
    np.savez(path, **arrays)
    assert read_back(model, out)["farthest_m"] == pytest.approx(0.001, abs=1e-6)
    assert read_back(model, out)["turned_rad"] == right["turned_rad"]
