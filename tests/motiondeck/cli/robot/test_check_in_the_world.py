"""`robot check` in the world: what is broken on purpose fails, by landmarks that the solver does not aim at."""

import json
import re

import numpy as np
import pytest

from benchmarks.robots.written_bend import written_bend
from command_line import invoked
from controller.motion.rotations import from_rotation_vector, multiply
from sim.retargeting import human_limbs
from sim.retargeting.robot_trunk import RobotTrunk
from small_robots import calibrated, full_humanoid

TILT = from_rotation_vector(np.array([0.0, np.radians(20.0), 0.0]))


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("world")
    (folder / "full.xml").write_text(full_humanoid(fingers=False))
    (folder / "full.toml").write_text(calibrated(folder / "full.xml").to_toml(folder))
    (folder / "deposit.bvh").write_text(written_bend(root_pitch=18.0, chest=60.0))
    return folder


def checked(files, robot="full.toml"):
    """The exit code and the row of the check of a deep bend."""
    result = invoked("robot", "check", files / robot, files / "deposit.bvh", "--seconds", "1.5", "--json")
    (row,) = json.loads(result.stdout)["recordings"]
    return result.exit_code, row


def test_a_deep_bend_passes_though_its_root_has_a_pitched_zero(files):
    code, row = checked(files)
    assert code == 0, row["verdict"]["words"]
    assert row["trunk_deg"]["worst"] < 2.0
    assert max(row["limbs_deg"][f"{side}_forearm"]["mean"] for side in "rl") < 3.0


@pytest.mark.thorough
def test_a_tilted_pelvis_fails(files, monkeypatch):
    right = RobotTrunk.rotation
    monkeypatch.setattr(RobotTrunk, "rotation", lambda self, pose: multiply(right(self, pose), TILT))
    code, row = checked(files)
    assert code == 1
    assert row["trunk_deg"]["mean"] == pytest.approx(20.0, abs=2.0)


@pytest.mark.thorough
def test_a_frozen_trunk_fails(files, monkeypatch):
    monkeypatch.setattr(RobotTrunk, "rotation", lambda self, pose: np.array([1.0, 0.0, 0.0, 0.0]))
    code, row = checked(files)
    assert code == 1
    assert "trunk leans elsewhere" in row["verdict"]["troubles"]
    assert row["trunk_deg"]["worst"] > 50.0


@pytest.mark.thorough
def test_a_chest_one_joint_short_fails(files, monkeypatch):
    right = human_limbs._way_to

    def short(skeleton, bone):
        above = int(skeleton.parent[skeleton.parent[bone]])  # of an upper arm it begins at Spine1
        return right(skeleton, above if "Arm" in skeleton.bones[bone] else bone)

    monkeypatch.setattr(human_limbs, "_way_to", short)
    code, row = checked(files)
    assert code == 1
    assert "trunk leans elsewhere" in row["verdict"]["troubles"]


@pytest.mark.thorough
def test_what_is_held_back_by_speed_has_a_tempo_at_which_it_is_not(files):
    text = re.sub(r"(?m)^velocity = .*", "velocity = 1.0", (files / "full.toml").read_text(), count=1)
    (files / "slow.toml").write_text(text)
    code, row = checked(files, "slow.toml")
    assert code == 1
    assert "held back" in {off.get("cause") for off in row["limbs_deg"].values()}
    slower = row["verdict"]["passes_at"]
    assert 0.1 < slower < 1.0
    said = invoked("robot", "check", files / "slow.toml", files / "deposit.bvh", "--seconds", "1.5").stdout
    assert f": at tempo {slower:.2f} (held back: " in said
    assert said.strip().splitlines()[-1] == "1 recording: 1 at a slower tempo"
    bend = (files / "deposit.bvh").read_text()
    for tempo, passes in ((0.98 * slower, True), (1.3 * slower, False)):
        (frame_time,) = re.findall(r"Frame Time: (\S+)", bend)
        longer = f"{float(frame_time) / tempo:.8f}"
        (files / "slower.bvh").write_text(bend.replace(frame_time, longer))
        seconds = f"{1.5 / tempo:.2f}"
        result = invoked("robot", "check", files / "slow.toml", files / "slower.bvh", "--seconds", seconds, "--json")
        assert (result.exit_code == 0) == passes


@pytest.mark.thorough
def test_an_elbow_at_the_wrong_hinge_fails(files):
    text = (files / "full.toml").read_text()
    for side, name in (("l", "left"), ("r", "right")):
        for part, wrong in (("upper_arm", "shoulder_roll"), ("forearm", "shoulder_yaw")):
            (line,) = [line for line in text.splitlines() if line.startswith(f"{side}_{part} =")]
            text = text.replace(line, f'{side}_{part} = "{name}_{wrong}"')
    (files / "wrong.toml").write_text(text)
    code, row = checked(files, "wrong.toml")
    assert code == 1
    assert row["limbs_deg"]["r_upper_arm"]["cause"] == row["limbs_deg"]["l_forearm"]["cause"] == "carried wrongly"
