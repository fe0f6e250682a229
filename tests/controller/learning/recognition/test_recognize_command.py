import json
from pathlib import Path

import pytest

from command_line import invoked
from controller.learning.recognition.labelled_recordings import read_dataset
from motiondeck_base.errors import MotiondeckError
from recognition_examples import amc, write_folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("recordings"))


def invoke(*words):
    result = invoked(*words)
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def test_a_folder_tells_motions_and_people(folder):
    dataset = read_dataset(folder)
    assert dataset.classes == ["arm", "leg"]
    assert {example.actor for example in dataset.examples} == {"P1", "P2"}
    assert len(dataset.examples) == 12
    assert dataset.skipped == []


def test_what_cannot_be_used_is_named_and_skipped(tmp_path):
    folder = write_folder(tmp_path)
    (folder / "leg" / "P1_broken.amc").write_text("nothing of the kind")
    (folder / "leg" / "P1_short.amc").write_text(amc("leg", 1))
    (folder / "leg" / "P9_stranger.amc").write_text(amc("leg", 20))
    (folder / "P1_loose.amc").write_text(amc("leg", 20))
    gap = amc("arm", 30).replace("root 0 17", "root nan 17", 1)
    (folder / "arm" / "P2_gap.amc").write_text(gap)
    other = amc("arm", 30).replace("arm", "tail")
    (folder / "arm" / "P2_other.amc").write_text(other)
    dataset = read_dataset(folder)
    assert len(dataset.examples) == 12
    said = " | ".join(dataset.skipped)
    for part in ("P1_broken", "P1_short.amc: 1 frames", "P9_stranger", "P1_loose", "P2_gap.amc line", "bone 'tail'"):
        assert part in said
    result = invoke("recognize", "train", folder, "--out", tmp_path / "r.safetensors", "--json")
    assert result.exit_code == 3
    assert len(json.loads(result.stdout)["skipped"]) == 6
    assert (tmp_path / "r.safetensors").is_file()


def test_a_folder_with_nothing_in_it_says_what_is_expected(tmp_path):
    with pytest.raises(MotiondeckError, match="folders named after motions"):
        read_dataset(tmp_path)
    with pytest.raises(MotiondeckError, match="no such folder"):
        read_dataset(tmp_path / "none")


def test_train_and_run(folder, tmp_path):
    out = tmp_path / "two.safetensors"
    trained = invoke("recognize", "train", folder, "--out", out)
    assert trained.exit_code == 0
    assert "12 clips of 2 motions: arm, leg" in trained.stdout
    asked = folder / "arm" / "P2_arm_1.amc"
    result = json.loads(invoke("recognize", "run", out, asked, "--json").stdout)
    assert result["results"][0]["motion"] == "arm"
    assert result["skipped"] == []
    plain = invoke("recognize", "run", out, asked, folder / "leg" / "P1_leg_0.amc").stdout
    assert ": arm, margin" in plain
    assert ": leg, margin" in plain
    streamed = json.loads(invoke("recognize", "run", out, asked, "--stream", "--json").stdout)["results"][0]
    assert "arm" in {span["motion"] for span in streamed["spans"]}
    assert streamed["spans"][-1]["to_s"] == pytest.approx(streamed["frames"] / 30.0)


@pytest.mark.thorough
def test_recordings_of_any_format_train_and_are_recognized_together(mocap_data, tmp_path):
    """Two motions by five people in three formats, at 30 and 120 Hz; asked about two others."""
    classes = {
        "walk": ["bvh/bandai/walk_normal_001.bvh", "cmu/35/35.asf", "cmu/35/35_01.amc"],
        "run": ["bvh/bandai/run_normal_001.bvh", "cmu/09/09.asf", "cmu/09/09_06.amc", "c3d/16_36_runjog.c3d"],
    }
    for motion, files in classes.items():
        (tmp_path / "all" / motion).mkdir(parents=True)
        for file in files:
            (tmp_path / "all" / motion / Path(file).name).symlink_to((mocap_data / file).resolve())
    out = tmp_path / "two.safetensors"
    assert "5 clips of 2 motions: run, walk" in invoke("recognize", "train", tmp_path / "all", "--out", out).stdout
    (tmp_path / "asked").mkdir()
    for file in ("bvh/bandai/walk_old_001.bvh", "cmu/02/02_03.amc", "cmu/02/02.asf"):
        (tmp_path / "asked" / Path(file).name).symlink_to((mocap_data / file).resolve())
    said = json.loads(invoke("recognize", "run", out, tmp_path / "asked", "--json").stdout)["results"]
    assert {Path(one["file"]).stem: one["motion"] for one in said} == {"walk_old_001": "walk", "02_03": "run"}


def test_one_wrong_clip_among_several_is_skipped_and_alone_it_is_an_error(folder, tmp_path):
    out = tmp_path / "two.safetensors"
    invoke("recognize", "train", folder, "--out", out)
    result = invoke("recognize", "run", out, folder / "none.amc", folder / "arm" / "P1_arm_0.amc", "--json")
    assert result.exit_code == 3
    assert len(json.loads(result.stdout)["results"]) == 1
    with pytest.raises(MotiondeckError, match="no such file"):
        invoke("recognize", "run", out, folder / "none.amc")


@pytest.fixture(scope="module")
def long_recording(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stream")
    from recognition_examples import ASF

    (folder / "P1.asf").write_text(ASF.format(name="P1"))
    frames = []
    for motion in ("leg", "arm", "leg", "arm"):
        frames += amc(motion, 360).splitlines()[2:]
    blocks = [frames[i : i + 4] for i in range(0, len(frames), 4)]
    text = [":FULLY-SPECIFIED", ":DEGREES"]
    for number, block in enumerate(blocks, 1):
        text += [str(number), *block[1:]]
    (folder / "P1_all.amc").write_text("\n".join(text) + "\n")
    return folder


def test_segment_finds_what_a_recognizer_knows(long_recording, folder, tmp_path):
    out = tmp_path / "two.safetensors"
    invoke("recognize", "train", folder, "--out", out)
    asked = ("segment", long_recording / "P1_all.amc", "--recognizer", out)
    report = json.loads(invoke(*asked, "--json").stdout)
    assert report["method"] == "experts"
    assert [one["motion"] for one in report["segments"]] == ["leg", "arm", "leg", "arm"]
    assert report["segments"][0]["from_frame"] == 0
    assert report["segments"][-1]["to_s"] == pytest.approx(12.0)
    borders = [one["from_frame"] for one in report["segments"][1:]]
    assert borders == pytest.approx([360, 720, 1080], abs=40)
    assert "arm" in invoke(*asked).stdout


def test_segment_says_what_is_missing(long_recording, tmp_path):
    recording = long_recording / "P1_all.amc"
    with pytest.raises(MotiondeckError, match="give one of them"):
        invoke("segment", recording, "--recognizer", recording, "--segments", "3")
    with pytest.raises(MotiondeckError, match="no such file"):
        invoke("segment", tmp_path / "none.amc")


def test_segment_cuts_without_labels_from_beginning_to_end(long_recording):
    report = json.loads(invoke("segment", long_recording / "P1_all.amc", "--json").stdout)
    starts = [one["from_s"] for one in report["segments"]]
    assert starts == sorted(starts)
    assert starts[0] == 0.0
    assert report["method"] == "changes"
    three = json.loads(invoke("segment", long_recording / "P1_all.amc", "--segments", "3", "--json").stdout)
    assert len(three["segments"]) == 3
