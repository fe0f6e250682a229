"""Tests of `motiondeck retarget`: its table, its exit codes and its JSON."""

import json

import joblib
import numpy as np
import pytest

import motiondeck
from command_line import invoked
from controller.motion.clip import Clip
from controller.motion.formats.writing import write_clip
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from simulated_bodies import bent_pose, human


@pytest.fixture(autouse=True)
def in_this_process():
    """Processes of their own take seconds to start."""
    with joblib.parallel_config(backend="threading"):
        yield


@pytest.fixture
def walk(tmp_path):
    poses = [bent_pose(human(), relb=(1.3, 0, 0), lelb=(-1.3, 0, 0), rank=(0, 0.01 * k, 0)) for k in range(31)]
    path, rotation = (np.array([getattr(p, key) for p in poses]) for key in ("root_position", "rotation"))
    write_clip(Clip("walk", human(), 60.0, path, rotation), tmp_path / "walk.bvh")
    return tmp_path / "walk.bvh"


def run(*arguments):
    result = invoked("retarget", *arguments)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def test_the_table_says_how_well_and_what_failed(walk, tmp_path):
    (tmp_path / "broken.bvh").write_text("HIERARCHY")
    result = run(walk, tmp_path / "broken.bvh", "--robot", "servo20", "--out", tmp_path / "out", "--format", "csv")
    assert result.exit_code == 1
    assert "walk.bvh" in result.output
    assert "failed: " in result.output
    assert "1 motion, 1 s, in" in result.output
    assert "1 failed" in result.output
    assert np.loadtxt(tmp_path / "out" / "walk.csv", delimiter=",").shape == (16, 27)


def test_json_holds_what_the_api_gives(walk, tmp_path):
    result = run(walk, "--robot", "servo20", "--out", tmp_path / "out", "--json")
    assert result.exit_code == 0
    row = json.loads(result.output)["recordings"][0]
    (same,) = motiondeck.retarget_files([walk], motiondeck.load_robot("servo20"), tmp_path / "api")
    assert row["file"] == same.file == "walk.npz"
    assert {name: tuple(pair) for name, pair in row["limbs_deg"].items()} == same.limbs_deg


def test_physical_says_for_each_motion_whether_the_robot_stands(tmp_path):
    pose = bent_pose(human(), relb=(1.3, 0, 0), lelb=(-1.3, 0, 0))
    place, rotation = (np.array([part] * 6) for part in (pose.root_position, pose.rotation))
    write_clip(Clip("stand", human(), 60.0, place, rotation), tmp_path / "stand.bvh")
    (tmp_path / "broken.bvh").write_text("HIERARCHY")
    files, out = (tmp_path / "stand.bvh", tmp_path / "broken.bvh"), tmp_path / "out"
    result = run(*files, "--robot", "servo20", "--out", out, "--physical")
    assert result.exit_code == 1
    assert "stands, 0.1 s" in result.output
    assert "failed: " in result.output
    assert "1 to the end on its feet; 1 failed" in result.output
    assert np.load(out / "stand.npz")["joint_pos"].shape == (5, 20)
    with pytest.raises(MotiondeckError, match="30 Hz"):
        run(*files, "--robot", "servo20", "--out", out, "--physical", "--format", "csv")


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        (("--robot", "servo21"), UnknownNameError, "servo20"),
        (("--robot", "mannequin", "--format", "csv"), None, "ball joints"),
    ],
)
def test_mistakes_are_named(walk, tmp_path, arguments, error, words):
    if error is None:
        result = run(walk, *arguments, "--out", tmp_path / "out")
        assert result.exit_code == 1
        assert words in result.output
        return
    with pytest.raises(MotiondeckError, match=words):
        run(walk, *arguments, "--out", tmp_path / "out")
