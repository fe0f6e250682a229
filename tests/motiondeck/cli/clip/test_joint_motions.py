"""`motiondeck clip` for a rig's joints: written or recorded, shown, cut, mirrored and converted."""

import json

import numpy as np
import pytest
from PIL import Image

from command_line import invoked
from controller.motion.encodings.joint_angles import angles_of
from controller.motion.formats.reading import read_clip
from controller.wire.run_recording import RecordingWriter
from motiondeck_base.errors import MotiondeckError

WINK = """
unit = "deg"
rest = { neck = 0, left_lid = 0, right_lid = 0 }
key = [
  { at = 0.5, pose = { left_lid = -30, neck = 8 } },
  { at = 1.0, pose = { left_lid = 0, neck = 0 } },
]
"""
RIG = """
port = "/dev/ttyUSB0"
baud = 1000000
rate_hz = 100
[[joints]]
name = "neck"
mirror = -1
"""
ROW = 'id = 1\nmodel = "XL330-M288"\ndirection = 1\nzero = 2048\nlower = -1.0\nupper = 1.0\nvelocity = 4.0\n'
MODEL = """
<mujoco><worldbody><body name="neck">
  <joint name="neck" axis="0 0 1"/><geom size="0.1"/>
  <body pos="0 0.1 0"><joint name="left_lid" axis="0 1 0"/><geom size="0.1"/></body>
  <body pos="0 -0.1 0"><joint name="right_lid" axis="0 {} 0"/><geom size="0.1"/></body>
</body></worldbody></mujoco>
"""


def run(*arguments):
    return invoked("clip", *arguments)


def angles(path):
    return np.degrees(angles_of(read_clip(path).rotation[:, 1:]))


@pytest.fixture
def wink(tmp_path):
    (tmp_path / "wink.toml").write_text(WINK)
    return tmp_path / "wink.toml"


def test_show_prints_ranges_and_speeds(wink):
    table = run("show", wink).stdout
    assert "101 frames at 100 Hz" in table
    assert "-30.0 to +0.0 deg, at most 90 deg/s" in table
    known = json.loads(run("show", wink, "--json").stdout)
    assert known["plays"] == "once"
    assert known["joints"]["left_lid"]["lower"] == pytest.approx(np.radians(-30))


def test_plot_draws_every_joint(wink, tmp_path):
    assert run("plot", wink, "--out", tmp_path / "wink.png").exit_code == 0
    assert Image.open(tmp_path / "wink.png").size[0] > 500
    assert isinstance(run("plot", wink, wink, "--out", tmp_path / "two.png").exception, MotiondeckError)
    assert "no body: `motiondeck clip plot` draws it" in str(run("view", wink).exception)


def test_a_piece_is_cut_out_and_converted(wink, tmp_path):
    said = run("convert", wink, tmp_path / "open.clip", "--from", "0.5", "--to", "1")
    assert "(50 frames of 3 joints, once)" in said.stdout
    assert run("convert", tmp_path / "open.clip", tmp_path / "open.csv").exit_code == 0
    assert angles(tmp_path / "open.csv") == pytest.approx(angles(wink)[50:100], abs=1e-9)
    assert (
        (tmp_path / "open.csv").read_text().startswith("# plays = once\n# rate = 100.0\ntime_s,neck_rad,left_lid_rad,")
    )


@pytest.mark.parametrize("source", ["rig", "model"])
@pytest.mark.parametrize("sign", [1, -1])
def test_twins_are_exchanged_with_their_signs(wink, tmp_path, source, sign):
    if source == "rig":
        file, lids = tmp_path / "head.toml", ("left_lid", "right_lid")
        rows = [f'[[joints]]\nname = "{name}"\nmirror = {sign}\n' for name in lids]
        file.write_text("".join(row + ROW.replace("id = 1", f"id = {n}") for n, row in enumerate([RIG, *rows])))
    else:
        file = tmp_path / "head.xml"
        file.write_text(MODEL.format(sign))
    once, twice = tmp_path / "once.clip", tmp_path / "twice.clip"
    assert run("convert", wink, once, "--mirror", "--skeleton", file).exit_code == 0
    assert angles(once) == pytest.approx(angles(wink)[:, [0, 2, 1]] * [-1, sign, sign])
    run("convert", once, twice, "--mirror", "--skeleton", file)
    assert angles(twice) == pytest.approx(angles(wink))


def test_a_mirror_that_is_not_known_is_refused(wink, tmp_path):
    problem = str(run("convert", wink, tmp_path / "out.clip", "--mirror").exception)
    assert "--mirror of joints needs --skeleton FILE" in problem
    (tmp_path / "head.xml").write_text(MODEL.format("1").replace("right_lid", "other_lid"))
    problem = str(
        run("convert", wink, tmp_path / "out.clip", "--mirror", "--skeleton", tmp_path / "head.xml").exception
    )
    assert "how left_lid, right_lid turns in a mirror is not known. Write mirror = 1 or -1" in problem


def test_a_recorded_run_becomes_a_motion(tmp_path):
    targets = np.stack([np.linspace(0.0, 1.0, 60), np.zeros(60)], axis=1)
    writer = RecordingWriter(tmp_path / "run.rec", {"joints": ["pan", "tilt"], "rate": 50.0}, {"targets": 2})
    writer.append(targets)
    writer.close()
    assert run("convert", tmp_path / "run.rec", tmp_path / "run.npz").exit_code == 0
    assert np.radians(angles(tmp_path / "run.npz")) == pytest.approx(targets)
    assert read_clip(tmp_path / "run.npz").skeleton.bones == ("pan", "tilt")
