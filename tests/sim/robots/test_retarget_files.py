"""Tests of carrying many recordings onto a robot: going on, what is infeasible, what fails."""

import json
import re
import shutil

import joblib
import numpy as np
import pytest

from controller.motion.clip import Clip
from controller.motion.formats.writing import write_clip
from controller.motion.rotations import multiply
from motiondeck_base.errors import MotiondeckError
from sim.robots import retarget_files as module
from sim.robots.retarget_files import MANIFEST, retarget_files
from simulated_bodies import bent_pose, human
from small_robots import calibrated, humanoid


@pytest.fixture(autouse=True)
def in_this_process():
    """Processes of their own take seconds to start."""
    with joblib.parallel_config(backend="threading"):
        yield


def clip_of(poses, rate=60.0):
    return Clip(
        "clip", human(), rate, np.array([p.root_position for p in poses]), np.array([p.rotation for p in poses])
    )


def standing(**bent):
    """Legs that hardly bend and arms that hang, as the small robot can have them."""
    return bent_pose(human(), relb=(1.3, 0, 0), lelb=(-1.3, 0, 0), **bent)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A robot, and recordings: one that it can do, one with its knees bent forward, one that cannot be read."""
    folder = tmp_path_factory.mktemp("batch")
    (folder / "small.xml").write_text(humanoid())
    (folder / "small.toml").write_text(calibrated(folder / "small.xml").to_toml(folder))
    takes = folder / "takes" / "deep"
    takes.mkdir(parents=True)
    easy = [standing(rank=(0, 0.2 * np.sin(0.1 * k) + 0.2, 0)) for k in range(31)]
    write_clip(clip_of(easy), takes / "easy.bvh")
    write_clip(clip_of([standing(rank=(0, -1.5, 0), lank=(0, -1.5, 0))] * 31), takes.parent / "bird.bvh")
    (takes.parent / "broken.bvh").write_text("HIERARCHY\nROOT hips\n")
    return folder


def run(folder, out, format="mjlab", paths=None):
    found = retarget_files(folder / "small.toml", paths or [folder / "takes"], out, format)
    return {row.recording.rpartition("/")[2]: row for row in found}


@pytest.fixture(scope="module")
def first(folder):
    with joblib.parallel_config(backend="threading"):
        return run(folder, folder / "out")


def test_files_lie_as_the_recordings_do_and_at_the_formats_rate(folder, first):
    easy = first["easy.bvh"]
    assert easy.file == "deep/easy.npz"
    assert easy.fps == 50.0
    assert easy.frames == 26
    assert np.load(folder / "out" / easy.file)["joint_pos"].shape == (26, 18)
    assert easy.verdict.answer == "plays"
    assert easy.limbs_deg["r_shank"][1] < 10.0


def test_what_a_robot_cannot_do_is_marked_in_name_and_manifest(folder, first):
    bird = first["bird.bvh"]
    assert bird.file == "bird.infeasible.npz"
    assert (folder / "out" / bird.file).exists()
    assert bird.verdict.answer == "does not fit"
    assert "_shank, 50 deg" in bird.verdict.words
    lines = [json.loads(line) for line in (folder / "out" / MANIFEST).read_text().splitlines()]
    assert lines[0]["format"] == "mjlab"
    assert {line["verdict"] and line["verdict"]["passes_at"] for line in lines[1:]} == {1.0, None}


def test_what_cannot_be_read_is_named_and_the_rest_is_done(first):
    broken = first["broken.bvh"]
    assert broken.file is None
    assert "broken.bvh" in str(broken.error)
    assert sum(row.error is None for row in first.values()) == 2


def test_a_second_run_does_only_what_is_new_or_changed(folder, first, tmp_path, monkeypatch):
    shutil.copytree(folder, tmp_path / "copy", copy_function=shutil.copy2)
    here, done = tmp_path / "copy", []
    run(here, here / "out")  # the recordings are elsewhere now
    carried = module._carried
    monkeypatch.setattr(module, "_carried", lambda *what: done.append(what[2].name) or carried(*what))
    rows = run(here, here / "out")
    assert done == ["broken.bvh"]
    assert rows["easy.bvh"].limbs_deg == first["easy.bvh"].limbs_deg
    (here / "out" / "deep" / "easy.npz").unlink()
    path = here / "takes" / "bird.bvh"
    write_clip(clip_of([standing()] * 31), path)
    # It was stopped in the middle of a line.
    with (here / "out" / MANIFEST).open("a") as manifest:
        manifest.write('{"recording": "x", "fi')
    done.clear()
    rows = run(here, here / "out")
    assert sorted(done) == ["bird.bvh", "broken.bvh", "easy.bvh"]
    assert rows["bird.bvh"].file == "bird.npz"
    assert not (here / "out" / "bird.infeasible.npz").exists()


def test_a_first_frame_apart_is_left_out_and_said(folder, tmp_path):
    easy = [standing()] * 31
    write_clip(clip_of([bent_pose(human()), *easy]), tmp_path / "tpose.bvh")
    row = run(folder, tmp_path / "out", "npz", [tmp_path / "tpose.bvh"])["tpose.bvh"]
    assert row.frames == 31
    assert row.notes == ("a pose before the motion is left out, frames: 1",)
    assert row.limbs_deg["r_upper_arm"][1] < 10.0


def test_a_body_that_jumps_is_infeasible(folder, tmp_path):
    pasted = clip_of([standing()] * 31)
    pasted.root_position[20:, 1] += 2.0
    write_clip(pasted, tmp_path / "pasted.bvh")
    row = run(folder, tmp_path / "out", "npz", [tmp_path / "pasted.bvh"])["pasted.bvh"]
    assert row.verdict.passes_at is None
    assert "broken: the body jumps by up to 2.0 m between two frames at 0.33 s" in row.verdict.words


@pytest.mark.parametrize("frames", [1, 2])
def test_a_limb_that_is_elsewhere_for_a_moment_is_infeasible(folder, tmp_path, frames):
    spiked = clip_of([standing()] * 31)
    elbow = 1 + spiked.skeleton.index("lelb")
    spiked.rotation[20 : 20 + frames, elbow] = multiply(np.array([0.0, 1.0, 0.0, 0.0]), spiked.rotation[20, elbow])
    write_clip(spiked, tmp_path / "spiked.bvh")
    row = run(folder, tmp_path / "out", "npz", [tmp_path / "spiked.bvh"])["spiked.bvh"]
    assert re.search(r"broken: the end of bone 'l\w+' is elsewhere for a moment at 0\.3\d s", row.verdict.words)
    assert row.file == "spiked.infeasible.npz"


def test_a_file_is_no_folder_to_write_into(folder, tmp_path):
    (tmp_path / "out").write_text("mine")
    with pytest.raises(MotiondeckError, match="out is a file, and --out names a folder"):
        run(folder, tmp_path / "out", "npz")
    assert (tmp_path / "out").read_text() == "mine"


def test_motions_of_another_robot_or_format_are_not_mixed(folder, first):
    with pytest.raises(MotiondeckError, match=r"out holds motions for small\.toml as mjlab.*--out"):
        run(folder, folder / "out", "csv")
    text = (folder / "small.toml").read_text()
    (folder / "other.toml").write_text(text + "\n# other\n")
    with pytest.raises(MotiondeckError, match=r"small\.toml"):
        list(retarget_files(folder / "other.toml", [folder / "takes"], folder / "out", "mjlab"))


@pytest.mark.parametrize(
    ("what", "complaint"),
    [("nothing", "no such file or folder"), ("empty", "no recording"), ("twice", "both become easy")],
)
def test_paths_that_cannot_be_used_are_named(folder, tmp_path, what, complaint):
    (tmp_path / "empty").mkdir()
    easy = folder / "takes" / "deep" / "easy.bvh"
    paths = {"nothing": [tmp_path / "nothing"], "empty": [tmp_path / "empty"], "twice": [easy, tmp_path / "easy.bvh"]}
    (tmp_path / "easy.bvh").write_bytes(easy.read_bytes())
    with pytest.raises(MotiondeckError, match=complaint):
        run(folder, tmp_path / "out", paths=paths[what])


def test_a_manifest_of_something_else_is_named(folder, tmp_path):
    (tmp_path / MANIFEST).write_text('{"robot": 3}\n')
    with pytest.raises(MotiondeckError, match=r"motions\.jsonl.*no manifest"):
        run(folder, tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(MotiondeckError, match=r"cannot be used.*another --out"):
        run(folder, tmp_path / "file" / "below")
