import json

import pytest

from command_line import invoked
from controller.motion.encodings.joint_angles import read_taught_clip
from motiondeck.cli.robot import rehearse
from motiondeck.cli.robot.rehearse import words


def run(*arguments):
    return invoked("robot", "rehearse", "servo20", *arguments)


@pytest.mark.thorough
def test_what_was_rehearsed_is_written_and_judged(tmp_path, monkeypatch):
    monkeypatch.setattr(rehearse, "COURSES", 4)
    out = tmp_path / "crawl.clip"
    result = run("crawl", "--out", out, "--rounds", "1", "--generations", "2", "--tries", "2", "--json")
    report = json.loads(result.stdout)
    assert result.exit_code == int(report["rehearsed"]["kept"] < 1.8)
    assert report["tries"] == 2
    assert report["as_played"]["kept"] <= 2
    assert 0.0 < report["rehearsed"]["joints_deg"] < 30.0
    clip = read_taught_clip(out)
    assert len(clip) / clip.rate == pytest.approx(report["seconds"])
    assert "r_hip_pitch" in clip.skeleton.bones


@pytest.mark.parametrize(("kept", "verdict"), [(20, "can do without a gantry"), (17, "should stay on the gantry")])
def test_the_verdict_is_what_it_kept(kept, verdict):
    row = {"kept": kept, "joints_deg": 7.0, "tilt_deg": 5.0, "height_percent": 2.0, "went_m": 0.2}
    report = {"motion": "crawl", "seconds": 3.0, "tries": 20, "asked_m": 0.28, "as_played": row, "rehearsed": row}
    report["file"] = "crawl.clip"
    assert verdict in words(report)
    assert (
        f"kept to the end {kept} of 20; joints 7, trunk 5 degrees off, root 2 % of its height; went 0.20 of 0.28 m"
        in words(report)
    )


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("crawling",), "unknown motion 'crawling'"),
        (("crawl", "--tempo", "0"), "--tempo 0 is not between 0.1 and 3"),
        (("crawl", "--tries", "0"), "--tries 0: at least 1"),
        (("crawl", "--generations", "0"), "--generations 0: at least 1"),
    ],
)
def test_what_cannot_be_rehearsed_is_refused(tmp_path, arguments, complaint):
    result = run(*arguments, "--out", tmp_path / "out.clip")
    assert complaint in str(result.exception)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("out", "complaint"),
    [("out.txt", "joint motions are written as .csv or .clip"), ("gone/out.clip", "there is no such folder")],
)
def test_a_place_that_cannot_be_written_is_refused_before_the_search(tmp_path, out, complaint):
    result = run("crawl", "--out", tmp_path / out)
    assert complaint in str(result.exception)


def test_a_seed_below_zero_is_refused(tmp_path):
    result = run("crawl", "--seed", "-1", "--out", tmp_path / "out.clip")
    assert result.exit_code == 2
    assert "--seed" in result.output
