import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import motiondeck_base
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.shipped import find_library, find_rig, find_robot, shipped_configs

ROOT = Path(__file__).parents[2]


def test_a_name_finds_the_shipped_file():
    assert find_robot("servo20") == shipped_configs() / "robots" / "servo20.toml"
    assert find_rig("servo20") == shipped_configs() / "rigs" / "servo20.toml"
    assert find_library("thesis15") == shipped_configs() / "libraries" / "thesis15.safetensors"


@pytest.mark.parametrize("kind", [str, Path])
def test_a_path_finds_that_file(tmp_path, monkeypatch, kind):
    (tmp_path / "own.toml").touch()
    assert find_robot(kind(tmp_path / "own.toml")) == tmp_path / "own.toml"
    monkeypatch.chdir(tmp_path)
    assert find_robot(kind("own.toml")) == Path("own.toml")
    # A file of the working directory never hides a shipped one of the same name.
    (tmp_path / "servo20").touch()
    assert find_robot(kind("servo20")).parent == shipped_configs() / "robots"


@pytest.mark.parametrize(
    ("find", "name", "message"),
    [
        (find_robot, "servo2", "unknown robot 'servo2'. Did you mean servo20?"),
        (find_rig, "arm", "unknown rig 'arm'. There are: pan-tilt, servo20, so101."),
        (find_library, Path("thesis16"), "unknown library 'thesis16'. Did you mean thesis15?"),
        (find_library, "", "unknown library ''. There are: cmu86, thesis15."),
    ],
)
def test_an_unknown_name_is_answered_with_the_nearest_ones(find, name, message):
    with pytest.raises(UnknownNameError) as caught:
        find(name)
    assert str(caught.value) == message


def test_a_file_of_another_kind_is_answered_with_how_to_make_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "walk.bvh").touch()
    with pytest.raises(MotiondeckError, match=r"walk.bvh: not a library file, .* motiondeck learn RECORDING"):
        find_library("walk.bvh")
    with pytest.raises(MotiondeckError, match=r"walk.bvh: not a library file, .* motiondeck learn RECORDING"):
        find_library(tmp_path / "walk.bvh")
    with pytest.raises(MotiondeckError, match=r"walk.bvh: not a robot file, which ends in .toml.* robot calibrate"):
        find_robot("walk.bvh")


def test_a_missing_path_is_answered_with_the_nearest_files(tmp_path, monkeypatch):
    (tmp_path / "walker.toml").touch()
    with pytest.raises(MotiondeckError, match=r"walkre.toml: there is no such file. Did you mean .*/walker.toml\?$"):
        find_robot(tmp_path / "walkre.toml")
    with pytest.raises(MotiondeckError, match=r"none/walker.toml: there is no such file$"):
        find_robot(str(tmp_path / "none" / "walker.toml"))
    with pytest.raises(MotiondeckError, match="there is no such file"):
        find_robot(tmp_path)


def test_an_installed_package_finds_the_files_inside_itself(tmp_path):
    inside = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    shutil.copytree(Path(motiondeck_base.__file__).parent, tmp_path / "motiondeck_base")
    (tmp_path / inside["force-include"]["configs"]).mkdir()
    run = subprocess.run(
        [sys.executable, "-S", "-c", "from motiondeck_base.shipped import shipped_configs; print(shipped_configs())"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.strip() == str(tmp_path / "motiondeck_base" / "configs")
