"""What recordings can be like: every fault is named, what is left is used, and the exit code says so."""

import json

import numpy as np
import pytest

from command_line import invoked
from controller.learning.recognition.recognizer import load_recognizer
from motiondeck_base.errors import MotiondeckError
from recognition_examples import ASF, amc, write_folder


def invoke(*words):
    result = invoked(*words)
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = write_folder(tmp_path_factory.mktemp("recordings"))
    out = folder / "two.safetensors"
    assert invoke("recognize", "train", folder, "--out", out).exit_code == 0
    return folder, out


def test_one_unreadable_file_among_two_hundred_is_named_and_the_others_are_learned(tmp_path, monkeypatch):
    monkeypatch.setattr("controller.learning.recognition.experts.STRETCHES", (1.0,))
    (tmp_path / "P1.asf").write_text(ASF.format(name="P1"))
    for motion in ("leg", "arm"):
        (tmp_path / motion).mkdir()
        for take in range(100):
            (tmp_path / motion / f"P1_{motion}_{take:03}.amc").write_text(amc(motion, 12, 1.0 + 0.002 * take))
    broken = tmp_path / "leg" / "P1_leg_042.amc"
    broken.write_bytes(bytes(range(256)) * 4)
    result = invoke("recognize", "train", tmp_path, "--out", tmp_path / "out.safetensors", "--json")
    said = json.loads(result.stdout)
    assert result.exit_code == 3
    assert said["clips"] == 199
    assert [str(broken) in line for line in said["skipped"]] == [True]
    assert f"skipped: {broken}" in result.stderr
    assert broken.name not in load_recognizer(tmp_path / "out.safetensors").sources


def test_a_folder_with_a_faulty_recording_ends_with_a_code_of_its_own(tmp_path):
    folder = write_folder(tmp_path)
    (folder / "arm" / "P1_gap.amc").write_text(amc("arm", 30).replace("leg 2.0000", "leg nan", 1))
    result = invoke("recognize", "train", folder, "--out", tmp_path / "x.safetensors")
    assert result.exit_code == 3
    assert "P1_gap.amc line" in result.stderr


FAULTS = {
    "gap": (amc("arm", 40).replace("arm 0 ", "arm nan ", 1), "gap.amc line"),
    "one frame": (amc("arm", 1), "too short to be recognized"),
    "nothing": ("", "nothing.amc"),
    "wrong skeleton": (amc("arm", 40).replace("arm", "tail"), "bone 'tail'"),
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("stream", [(), ("--stream",)])
def test_a_faulty_recording_is_refused_alone_and_skipped_among_others(trained, tmp_path, fault, stream):
    folder, recognizer = trained
    text, said = FAULTS[fault]
    bad = tmp_path / f"{fault}.amc"
    bad.write_text(text)
    words = ("recognize", "run", recognizer, bad, "--skeleton", folder / "P1.asf", *stream)
    with pytest.raises(MotiondeckError, match=said):
        invoke(*words)
    result = invoke(*words, folder / "arm" / "P1_arm_0.amc", "--json")
    assert result.exit_code == 3
    assert [bad.name in line for line in json.loads(result.stdout)["skipped"]] == [True]
    assert len(json.loads(result.stdout)["results"]) == 1


def test_the_skeleton_of_another_body_is_refused_by_its_joints(trained, tmp_path):
    _, recognizer = trained
    (tmp_path / "other.asf").write_text(ASF.format(name="other").replace("arm", "wing"))
    (tmp_path / "other.amc").write_text(amc("arm", 40).replace("arm", "wing"))
    with pytest.raises(MotiondeckError, match=r"skeleton 'other' has no bone arm.*Train with this kind of skeleton"):
        invoke("recognize", "run", recognizer, tmp_path / "other.amc")


def test_joints_that_never_move_do_no_harm(tmp_path):
    """Of fingers and collar bones the recordings say nothing: their channels are constant."""
    (tmp_path / "P1.asf").write_text(ASF.format(name="P1"))
    for motion, still in (("leg", "arm"), ("nothing", "arm")):
        (tmp_path / motion).mkdir()
        for take in range(3):
            lines = amc("leg", 60 + take, 1.0 + 0.1 * take).splitlines()
            moving = ("leg", "arm") if motion == "nothing" else (still,)
            lines = [f"{line.split()[0]} 0 0 0" if line.startswith(moving) else line for line in lines]
            (tmp_path / motion / f"P1_{take}.amc").write_text("\n".join(lines) + "\n")
    out = tmp_path / "still.safetensors"
    assert invoke("recognize", "train", tmp_path, "--out", out).exit_code == 0
    for motion in ("leg", "nothing"):
        result = json.loads(invoke("recognize", "run", out, tmp_path / motion / "P1_1.amc", "--json").stdout)
        assert result["results"][0]["motion"] == motion
        assert np.isfinite(list(result["results"][0]["costs"].values())).all()
