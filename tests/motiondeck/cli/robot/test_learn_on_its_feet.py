"""Tests of `motiondeck learn --physical`: what a robot does on its own feet is learned, and that alone."""

import json
from pathlib import Path

import numpy as np
import pytest

import motiondeck
from command_line import invoked
from controller.motion.clip import Clip
from controller.motion.encodings.joint_angles import angles_of
from controller.motion.formats.writing import write_clip
from motiondeck_base.errors import MotiondeckError
from simulated_bodies import bent_pose, human

FILES = ["falls.infeasible.npz", "stands.feedback", "stands.npz"]


def recorded(folder, name, rises, frames):
    """A human who raises an arm, and itself by so many m/s."""
    poses = [bent_pose(human(), relb=(1.3 - 0.01 * k, 0, 0), lelb=(-1.3, 0, 0)) for k in range(frames)]
    path, rotation = (np.array([getattr(pose, key) for pose in poses]) for key in ("root_position", "rotation"))
    path[:, 2] += rises * np.arange(frames) / 60.0
    write_clip(Clip(name, human(), 60.0, path, rotation), folder / f"{name}.bvh")
    return folder / f"{name}.bvh"


def learn(*arguments):
    result = invoked("learn", *arguments)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.mark.thorough
def test_what_stands_is_learned_as_the_joints_of_the_robot_and_what_falls_is_said(tmp_path):
    stands, falls = recorded(tmp_path, "stands", 0.0, 25), recorded(tmp_path, "falls", 3.0, 40)
    out = tmp_path / "mine.safetensors"
    result = json.loads(learn(stands, falls, "--robot", "servo20", "--out", out, "--physical", "--json").stdout)
    assert [(row["name"], row["passed"]) for row in result["motions"]] == [("stands", True)]
    found = {Path(row["recording"]).stem: row for row in result["on_its_feet"]}
    assert found["stands"]["fell_s"] is None
    assert 0.2 < found["falls"]["fell_s"] < 0.65
    assert found["stands"]["held"] > 0.5
    assert found["falls"]["held"] is None
    assert sorted(path.name for path in (tmp_path / "mine").iterdir()) == FILES

    played = motiondeck.load_library(out).generate_clip("stands", seconds=0.4, rate=50.0)
    with np.load(tmp_path / "mine" / "stands.npz") as file:
        names, angles = file["joint_names"].tolist(), file["joint_pos"][:10]  # a one-shot ends more slowly
    order = [names.index(joint) for joint in played.skeleton.bones]
    assert len(order) == 20
    assert np.abs(angles_of(played.rotation[:10, 1:]) - angles[:, order]).max() < 0.001
    assert np.ptp(angles, axis=0).max() > 0.05

    free = ("--library", out, "--robot", "servo20", "--root", "free", "--headless", "--command-port", "0", "--json")
    for balance, given in ((), True), (("--balance",), False):
        output = json.loads(invoked("play", "stands", *free, *balance, "--seconds", "0.2").stdout)["outputs"][0]
        assert output["feedback"] is given


def test_without_a_robot_or_recordings_it_is_refused(tmp_path):
    with pytest.raises(MotiondeckError, match="--physical is for recordings"):
        learn(recorded(tmp_path, "arm", 0.0, 5), "--physical")


def test_where_nothing_stands_no_library_is_written(tmp_path):
    out = tmp_path / "mine.safetensors"
    with pytest.raises(MotiondeckError, match="ball joints cannot be searched"):
        learn(recorded(tmp_path, "arm", 0.0, 5), "--robot", "mannequin", "--out", out, "--physical")
    assert not out.exists()


def test_joint_angles_have_no_path_to_follow(tmp_path):
    np.savez(tmp_path / "nod.npz", time_s=np.arange(5) / 50.0, head_pan_rad=np.zeros(5))
    with pytest.raises(MotiondeckError, match="lost their path"):
        learn(tmp_path / "nod.npz", "--robot", "servo20", "--out", tmp_path / "mine.safetensors", "--physical")


def test_two_recordings_of_one_name_do_not_become_one_file(tmp_path):
    (tmp_path / "again").mkdir()
    files = recorded(tmp_path, "arm", 0.0, 5), recorded(tmp_path / "again", "arm", 0.0, 5)
    with pytest.raises(MotiondeckError, match="another recording has this name"):
        learn(*files, "--robot", "servo20", "--out", tmp_path / "mine.safetensors", "--physical")


def test_a_folder_that_is_there_is_not_written_into(tmp_path):
    (tmp_path / "mine").mkdir()
    with pytest.raises(MotiondeckError, match="mine exists already"):
        learn(
            recorded(tmp_path, "arm", 0.0, 5),
            *("--robot", "servo20", "--out", tmp_path / "mine.safetensors", "--physical"),
        )
    assert list((tmp_path / "mine").iterdir()) == []
