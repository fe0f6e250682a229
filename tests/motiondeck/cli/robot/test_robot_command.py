import json
import re

import numpy as np
import pytest

from command_line import invoked
from controller.motion.clip import Clip
from controller.motion.formats.writing import write_clip
from motiondeck.cli.common import verdict_report
from motiondeck.cli.robot import calibration
from motiondeck_base.errors import MotiondeckError
from simulated_bodies import bent_pose, human, smooth_poses
from small_robots import SERVOS, full_humanoid, humanoid, urdf


def run(*arguments):
    result = invoked("robot", *arguments)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.fixture(autouse=True, scope="module")
def a_short_trial():
    """Calibrated robots walk for a moment only."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibration, "MOTIONS", ("walk",))
        patch.setattr(calibration, "SECONDS", 0.2)
        patch.setattr(verdict_report, "verdicts_on", lambda *what: [])
        yield


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder with a model, its robot file and a recording."""
    folder = tmp_path_factory.mktemp("robot")
    (folder / "small.xml").write_text(humanoid())
    run("calibrate", folder / "small.xml", "--out", folder / "small.toml")
    poses = smooth_poses(human(), np.random.default_rng(1), 40, reach=0.4)
    clip = Clip(
        "swing", human(), 60.0, *(np.array([getattr(p, k) for p in poses]) for k in ("root_position", "rotation"))
    )
    write_clip(clip, folder / "swing.bvh")
    return folder


def test_the_shipped_robots_are_listed():
    assert [robot["name"] for robot in json.loads(run("list", "--json").stdout)["robots"]] == ["mannequin", "servo20"]


def test_a_robot_is_shown_with_its_joints_and_parts():
    said = json.loads(run("show", "servo20", "--json").stdout)
    assert len(said["joints"]) == 20
    assert said["parts"]["l_foot"] == "l_foot"
    assert "left knee" not in run("show", "mannequin").stdout


@pytest.mark.thorough
def test_calibrate_says_what_it_found_and_replaces_nothing_unasked(files):
    out = files / "again.toml"
    said = json.loads(run("calibrate", files / "small.xml", "--out", out, "--json").stdout)
    assert said["solvers"] == ["ik", "angles"]
    assert said["parts"]["r_shank"] == "right_shank"
    with pytest.raises(MotiondeckError, match="exists already"):
        run("calibrate", files / "small.xml", "--out", out)
    assert run("calibrate", files / "small.xml", "--out", out, "--force").exit_code == 0


def test_calibrate_says_what_it_does_not_play(tmp_path):
    servos = [name for name in SERVOS if name != "left_ankle_roll"]
    text = humanoid(servos=servos).replace('<joint name="left_elbow"', '<joint name="left_elbow" type="slide"')
    chain = '<equality><connect body1="left_sole" body2="right_sole" anchor="0 0 0"/></equality>'
    (tmp_path / "odd.xml").write_text(text.replace("</mujoco>", f"{chain}</mujoco>"))
    result = run("calibrate", tmp_path / "odd.xml", "--out", tmp_path / "odd.toml")
    said = result.stdout
    assert "not played, because only hinges and ball joints with actuators are: left_elbow" in said
    assert "not played, because no actuator of the model drives them: left_ankle_roll" in said
    assert "closed chains of bodies (1 connect or weld constraint)" in said
    assert "how fast 16 joints may turn" in said


@pytest.mark.thorough
def test_limbs_that_never_point_as_the_humans_do_are_an_error_whatever_the_cause(tmp_path):
    text = full_humanoid(spread=0.95 * np.pi)  # its hands are up
    text = re.sub(r'(name="\w+_shoulder_\w+_joint" axis="[^"]*") range="-2.5 2.5"', r'\1 range="-.1 .1"', text)
    (tmp_path / "up.xml").write_text(text)
    result = run("calibrate", tmp_path / "up.xml", "--out", tmp_path / "up.toml")
    assert result.exit_code == 1
    assert "hardly its limbs: r_upper_arm, l_upper_arm; if other bodies are, name them" in result.stdout


@pytest.mark.parametrize("solver", ["ik", "angles"])
def test_check_measures_each_recording(files, solver):
    result = run("check", files / "small.toml", files / "swing.bvh", "--solver", solver, "--json")
    (row,) = json.loads(result.stdout)["recordings"]
    # Two servos a shoulder cannot follow every arm; the exit code says whether they did as well as they could.
    within = all(
        (off["mean"] <= 15.0 and off["worst"] <= 45.0) or off["cause"] == "out of reach"
        for off in row["limbs_deg"].values()
    )
    assert result.exit_code == (0 if within else 1)
    assert set(row["limbs_deg"]) == {f"{s}_{p}" for s in "rl" for p in ("thigh", "shank", "upper_arm", "forearm")}
    assert row["frames"] == 40
    assert row["bad"] == row["beyond"] == row["too_fast"] == row["jumps"] == 0
    assert row["sunk"] < 1e-6
    assert not {"knee", "ankle", "elbow", "wrist"} & set(row)  # one vocabulary: limbs_deg
    if solver == "ik":
        assert 0.0 < row["short_rms"] < row["short_worst"] < 0.1
    else:
        assert row["past_range"] >= 0


def test_what_cannot_be_reached_is_shown(files):
    clip = Clip(
        "ahead", human(), 60.0, np.zeros((9, 3)), np.array([bent_pose(human(), rank=(0, -1.0, 0)).rotation] * 9)
    )
    write_clip(clip, files / "ahead.bvh")  # a knee that bends forward
    rows = [
        json.loads(run("check", files / "small.toml", files / "ahead.bvh", "--solver", solver, "--json").stdout)
        for solver in ("ik", "angles")
    ]
    assert rows[0]["recordings"][0]["short_worst"] > 0.02
    assert rows[1]["recordings"][0]["past_range"] >= 9
    (files / "ahead.bvh").unlink()


def squats(path):
    """Twelve frames of a human who bends knees and elbows."""
    poses = [
        bent_pose(
            human(),
            relb=(1.3, 0, 0), lelb=(-1.3, 0, 0), rwri=(0, 0, 0.08 * k), lwri=(0, 0, -0.08 * k),
            rkne=(0, -0.06 * k, 0), lkne=(0, -0.06 * k, 0), rank=(0, 0.12 * k, 0), lank=(0, 0.12 * k, 0),
            rfoo=(0, 0.3 - 0.06 * k, 0), lfoo=(0, 0.3 - 0.06 * k, 0),
        )
        for k in range(12)
    ]  # fmt: skip
    write_clip(Clip("squats", human(), 30.0, np.zeros((12, 3)), np.array([p.rotation for p in poses])), path)


def test_the_check_fails_when_a_knee_is_moved_to_the_yaw_hinge(tmp_path):
    (tmp_path / "full.xml").write_text(full_humanoid())
    squats(tmp_path / "squats.bvh")
    file = tmp_path / "full.toml"
    assert run("calibrate", tmp_path / "full.xml", "--out", file).exit_code == 0
    result = run("check", file, tmp_path / "squats.bvh")
    assert result.exit_code == 0, result.stdout
    assert result.stdout.strip().splitlines()[-1] == "1 recording: 1 play"
    text = file.read_text()
    for side, name in (("l", "left"), ("r", "right")):
        text = text.replace(f'{side}_thigh = "{name}_hip_yaw"', f'{side}_thigh = "{name}_hip_roll"')
        text = text.replace(f'{side}_shank = "{name}_shin"', f'{side}_shank = "{name}_hip_yaw"')
    file.write_text(text)
    result = run("check", file, tmp_path / "squats.bvh")
    assert result.exit_code == 1
    assert re.search(r"\S+squats\.bvh: does not fit \(carried wrongly: \w+, \d+ deg", result.stdout)
    said = r"\S+squats\.bvh: carried wrongly: .*l_thigh \d+ degrees on average, "
    assert re.search(said + r"\d+ at worst at 0\.\d\d s \(out of reach: \d+ and \d+\)", result.stdout)
    assert "\ncarried wrongly: a wrong body under [parts]" in result.stdout
    assert result.stdout.strip().splitlines()[-1] == "1 recording: 1 do not fit"
    failed = json.loads(run("check", file, tmp_path / "squats.bvh", "--json").stdout)
    assert failed["verdict"] == result.stdout.strip().splitlines()[-1]
    assert failed["recordings"][0]["verdict"]["answer"] == "does not fit"
    # The trial of `calibrate` sees it too.
    assert "l_thigh" in calibration.try_robot(file).wrong


@pytest.mark.thorough
def test_calibrate_shows_what_limbs_measure_and_which_line_to_edit(tmp_path):
    model = tmp_path / "short.xml"
    model.write_text(
        full_humanoid().replace('<body name="right_fore" pos="0 0 -0.1">', '<body name="right_fore" pos="0 0 -0.02">')
    )
    file = tmp_path / "short.toml"
    result = run("calibrate", model, "--out", file)
    lines = file.read_text().splitlines()
    line = next(k for k, words in enumerate(lines, 1) if words.startswith("l_upper_arm"))
    assert "left_knee" in result.stdout
    assert f'line {line} of {file}: l_upper_arm = "left_shoulder_yaw"' in result.stdout
    assert "differ" in result.stdout
    found = json.loads(run("calibrate", model, "--out", file, "--force", "--json").stdout)
    shank = next(segment for segment in found["segments"] if segment["part"] == "shank")
    assert shank["hinge"] == {"r": "right_knee", "l": "left_knee"}
    assert shank["length_m"] == {"r": 0.3, "l": 0.3}
    assert shank["axis"]["l"] == [0.0, 1.0, 0.0]
    assert 0.25 < shank["human_m"] < 0.4


@pytest.mark.thorough
def test_calibrate_fails_where_limbs_point_elsewhere_though_joints_could_turn_there(files, monkeypatch):
    found = calibration.try_robot(files / "small.toml")
    assert not found.wrong
    arguments = "calibrate", files / "small.xml", "--out", files / "tried.toml", "--force"
    assert run(*arguments).exit_code == 0
    causes = {"l_shank": "carried wrongly", "r_forearm": "out of reach"}
    monkeypatch.setattr(calibration, "try_robot", lambda file: calibration.CalibrationTrial(found.off, causes))
    result = run(*arguments)
    assert result.exit_code == 1
    assert "error: limbs that point elsewhere than the human's, carried wrongly: l_shank" in result.stdout
    assert "warning: limbs that point elsewhere than the human's, out of reach: r_forearm" in result.stdout
    causes.pop("l_shank")
    assert run(*arguments).exit_code == 0


def test_a_robot_without_arms_is_written_with_an_error_code(tmp_path):
    (tmp_path / "legs.urdf").write_text(urdf())
    result = run("calibrate", tmp_path / "legs.urdf", "--out", tmp_path / "legs.toml")
    assert result.exit_code == 1
    assert "error: no right arm was found" in result.stdout
    assert (tmp_path / "legs.toml").exists()


def test_check_finds_recordings_in_folders_and_goes_past_what_it_cannot_read(files):
    (files / "torn.bvh").write_text("HIERARCHY\n")
    result = run("check", files / "small.toml", files, "--seconds", "0.2")
    assert result.exit_code == 1
    assert "1 recording," in result.stdout
    assert "not read" in result.stdout
    last = result.stdout.strip().splitlines()[-1]
    assert last.startswith("2 recordings: ")
    assert last.endswith("1 not read")


def test_help_says_what_it_means():
    assert "[parts]" in run("calibrate", "--help").stdout
    assert "default" not in run("check", "--help").stdout


def test_what_is_not_there_is_said(files, tmp_path):
    with pytest.raises(MotiondeckError, match="no recording found"):
        run("check", "servo20", tmp_path)
    with pytest.raises(MotiondeckError, match="no such model file"):
        run("calibrate", tmp_path / "nobody.xml")
