"""The recognition benchmark reports, prints and draws what it measures."""

import json
import sys

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from benchmarks.recognition.recognition import main
from motiondeck_base.errors import MotiondeckError
from recognition_examples import ASF, amc, write_folder

APP = typer.Typer()
APP.command()(main)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("recordings"))


def invoke(*words):
    result = CliRunner().invoke(APP, [str(word) for word in words])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def test_the_benchmark_reports_and_draws_all_it_measures(folder, tmp_path):
    pytest.importorskip("matplotlib")
    words = ("--method", "ours)", "--method", "mean pose", "--method", "templates", "--seeds", 2, "--json")
    pictures = tmp_path / "pictures"
    result = invoke(folder, "--protocol", "actor-out", *words, "--plot", pictures)
    assert result.exit_code == 0
    report = json.loads(result.stdout)
    measured = {one["method"]: one for one in report["results"]}
    assert set(measured) == {"experts (ours)", "nearest mean pose"}
    assert measured["experts (ours)"]["accuracy"] == 1.0
    assert measured["experts (ours)"]["confusion"] == [[12, 0], [0, 12]]
    assert "lfemur" in report["unable"]["motion templates"]
    assert len(report["time_warp"]["actor-out"]) == 7
    assert report["time_warp"]["actor-out, learned at three stretches"][3] == {"x": 1.0, "accuracy": 1.0}
    assert report["cost"]["classes"] == 2
    assert {row["bias"] for row in report["first_check"]} == {True, False}
    drawn = {path.name for path in pictures.iterdir()}
    assert {"recognition-methods.png", "confusion-ours-actor-out.png", "time-warp.png"} <= drawn
    assert len(report["pictures"]) == len(drawn)


def test_the_benchmark_prints_a_table(folder):
    shown = invoke(folder, "--protocol", "half", "--method", "mean pose").stdout
    assert "nearest mean pose" in shown
    assert "12 clips, 2 motions, 2 actors" in shown


def test_without_matplotlib_it_says_what_to_install(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MotiondeckError, match=r"motiondeck\[plot\]"):
        invoke(folder, "--plot", "x")


def test_names_that_do_not_exist_are_answered_with_those_that_do(folder):
    with pytest.raises(MotiondeckError, match="actor-out"):
        invoke(folder, "--protocol", "actor-in")
    with pytest.raises(MotiondeckError, match="no method has 'magic'"):
        invoke(folder, "--method", "magic")


def test_joints_that_never_move_leave_every_method_finite(tmp_path):
    (tmp_path / "P1.asf").write_text(ASF.format(name="P1"))
    for motion in ("leg", "nothing"):
        (tmp_path / motion).mkdir()
        for take in (1, 2):
            (tmp_path / motion / f"P1_{take}.amc").write_text(amc(motion, 60))
    names = ("experts (ours)", "linear", "Gaussian", "Eros", "conceptor")
    shown = invoke(tmp_path, "--protocol", "half", *(word for name in names for word in ("--method", name)), "--json")
    assert np.isfinite([one["accuracy"] for one in json.loads(shown.stdout)["results"]]).all()


def test_a_folder_with_a_faulty_recording_ends_with_a_code_of_its_own(tmp_path):
    folder = write_folder(tmp_path)
    (folder / "arm" / "P1_gap.amc").write_text(amc("arm", 30).replace("leg 2.0000", "leg nan", 1))
    result = invoke(folder, "--method", "mean pose", "--protocol", "half")
    assert result.exit_code == 3
    assert "P1_gap.amc line" in result.stderr
