"""`motiondeck clip` as a user meets it."""

import io
import json

import numpy as np
import pytest
from PIL import Image

from bodies import waving
from command_line import invoked
from controller.motion.formats.markers.c3d import read_c3d
from controller.motion.formats.reading import read_clip
from controller.motion.formats.writing import bvh_text
from motiondeck_base.errors import MotiondeckError
from recordings import BVH, MARKER_RATE, c3d_bytes, markers


def run(*arguments):
    return invoked("clip", *arguments)


@pytest.fixture
def bow(tmp_path):
    (tmp_path / "bow.bvh").write_text(BVH)
    return tmp_path / "bow.bvh"


def test_show_prints_a_table_or_json(bow):
    table = run("show", bow)
    assert table.exit_code == 0
    assert "14 bones, legs 0.88 m" in table.stdout
    known = json.loads(run("show", bow, "--json").stdout)
    assert (known["frames"], known["rate"], known["gaps"]) == (2, 120.0, None)


def test_convert_and_convert_back(bow, tmp_path):
    said = run("convert", bow, tmp_path / "again.bvh")
    assert said.stdout == f"wrote {tmp_path / 'again.bvh'} (2 frames of 14 bones)\n"
    assert run("convert", tmp_path / "again.bvh", tmp_path / "bow.csv").exit_code == 0
    assert len((tmp_path / "bow.csv").read_text().splitlines()) == 3


def test_a_piece_is_cut_out(tmp_path):
    (tmp_path / "wave.bvh").write_text(bvh_text(waving(60.0, 3.0)))
    said = run("convert", tmp_path / "wave.bvh", tmp_path / "piece.bvh", "--from", "0.5", "--to", "1.5")
    assert "60 frames" in said.stdout
    whole, piece = (read_clip(tmp_path / name) for name in ("wave.bvh", "piece.bvh"))
    np.testing.assert_allclose(piece.joints(), whole.joints()[30:90], atol=1e-5)


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("show", "gone.bvh"), "gone.bvh: cannot be read"),
        (("show", "bow.xyz"), "'.xyz' files are not read"),
        (("convert", "bow.bvh", "b.bvh", "--from", "3"), "bow.bvh: from 3 s to its end is no piece of 0.02 s"),
        (("convert", "bow.bvh", "./bow.bvh"), "bow.bvh: this is the recording itself"),
        (("convert", "--mirror", "bow.bvh", "bow.bvh"), "bow.bvh: this is the recording itself"),
        (("convert", "bow.bvh", "bow.fbx"), "bow.fbx: clips are written as .bvh or .csv"),
        (("view", "bow.bvh", "--robot", "servo21"), "unknown robot 'servo21'. Did you mean servo20?"),
        (("plot", "bow.bvh", "--out", "bow.nothing"), "bow.nothing: cannot be drawn"),
        (("convert", "--fill", "bow.bvh", "bow.c3d"), "bow.bvh: only markers (.c3d) have gaps"),
        (("convert", "--fill", "bow.c3d", "bow.csx"), "bow.csx: markers are written as .c3d or .csv"),
        (("convert", "--fill", "bow.c3d", "no/bow.c3d"), "no: there is no such folder"),
        (("convert", "--fill", "bow.c3d", "./bow.c3d"), "bow.c3d: this is the recording itself"),
        (("convert", "--fill", "gone.c3d", "bow.c3d"), "gone.c3d: cannot be read"),
        (("convert", "--fill", "gone.c3d", "bow.c3d", "--mirror"), "--fill writes the whole file"),
    ],
)
def test_a_mistake_is_one_line(bow, monkeypatch, arguments, problem):
    monkeypatch.chdir(bow.parent)
    said = run(*arguments)
    assert isinstance(said.exception, MotiondeckError)
    assert problem in str(said.exception)
    assert len(str(said.exception).splitlines()) == 1


def test_brackets_in_a_name_are_no_markup(bow):
    named = bow.rename(bow.with_name("bow [bold] (2).bvh"))
    assert "bow [bold] (2).bvh" in run("show", named).stdout


def test_a_hand_alone_has_no_legs(tmp_path):
    hand = tmp_path / "hand.bvh"
    rotations = "CHANNELS 3 Zrotation Xrotation Yrotation"
    joints = "".join(
        f"JOINT {finger}\n{{\nOFFSET {x} 8 0\n{rotations}\nEnd Site\n{{\nOFFSET 0 5 0\n}}\n}}\n"
        for x, finger in enumerate(("Thumb", "Index", "Middle", "Ring"))
    )
    root = f"ROOT Hand\n{{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition {rotations[11:]}\n{joints}}}\n"
    frames = "\n".join(f"0 100 0 {' '.join(str(k * n) for n in range(15))}" for k in range(3))
    hand.write_text(f"HIERARCHY\n{root}MOTION\nFrames: 3\nFrame Time: 0.02\n{frames}\n")
    said = run("show", hand)
    assert said.exception is None
    assert " bones; no left thigh" in said.stdout
    assert "parts were found" not in said.stdout
    assert "doubt: skeleton 'hand': no left leg was found" in said.stdout


@pytest.mark.thorough
def test_curves_and_sheets_are_drawn(bow, tmp_path):
    pytest.importorskip("matplotlib")
    assert run("plot", bow, "--out", tmp_path / "curves.png").exit_code == 0
    picture = np.asarray(Image.open(tmp_path / "curves.png").convert("L"))
    assert picture.std() > 10
    said = run("plot", bow, bow, "--out", tmp_path / "sheet.png")
    if said.exit_code and "OpenGL" in str(said.exception):
        pytest.skip("no off-screen OpenGL here")
    assert Image.open(io.BytesIO((tmp_path / "sheet.png").read_bytes())).size == (120 + 8 * 200, 440)


def test_left_and_right_are_exchanged(bow, tmp_path):
    said = run("convert", bow, tmp_path / "other.bvh", "--mirror", "--json")
    assert said.exit_code == 0, said.output
    assert json.loads(said.stdout)["written"] == str(tmp_path / "other.bvh")
    one, other = (read_clip(file) for file in (bow, tmp_path / "other.bvh"))
    assert len(other) == len(one)
    assert other.root_position[:, 1] == pytest.approx(-one.root_position[:, 1], abs=1e-3)


@pytest.mark.thorough
def test_lost_markers_are_filled_in(tmp_path):
    seen = markers(200, 6)
    lost = seen.copy()
    lost[80:110, 3] = np.nan
    lost[10:, 5] = np.nan
    file = tmp_path / "lost.c3d"
    file.write_bytes(c3d_bytes(["A", "B", "C", "D", "E", "*6"], lost, rate=MARKER_RATE))
    said = run("convert", "--fill", file, tmp_path / "filled.c3d", "--json")
    assert said.exit_code == 0, said.output
    rows = {row["marker"]: row for row in json.loads(said.stdout)["markers"]}
    assert rows["D"]["open"] == []
    assert rows["D"]["expected_mm"] < 10.0
    assert rows["*6"]["open"] == [[10, 200]]
    filled = read_c3d(tmp_path / "filled.c3d").position
    assert np.abs(filled[80:110, 3] - 1e-3 * seen[80:110, 3]).mean() < 0.006
    assert np.isnan(filled[10:, 5]).all()
    table = run("convert", "--fill", file, tmp_path / "filled.csv")
    assert "1 of 2 gaps filled" in table.stdout
    assert "10 to 199" in table.stdout
    assert len((tmp_path / "filled.csv").read_text().splitlines()) == 201
