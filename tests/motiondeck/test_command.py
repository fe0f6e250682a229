"""Packages of other people in front of ours are noticed before anything of theirs is imported."""

import subprocess
import sys
from pathlib import Path

import pytest

from motiondeck.command import PACKAGES, shadowed

CHECKOUT = Path(__file__).parents[2]


def run(arguments, folder, path=CHECKOUT):
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        cwd=folder,
        env={"PYTHONPATH": str(path), "PATH": ""},
        timeout=60,
        check=False,
    )


@pytest.fixture
def foreign(tmp_path):
    """A folder with a package of another project."""
    (tmp_path / "sim").mkdir()
    (tmp_path / "sim" / "__init__.py").write_text("raise SystemExit('imported')")
    return tmp_path


def test_our_own_packages_stand_beside_each_other():
    assert list(shadowed()) == []


def test_packages_elsewhere_are_named(tmp_path):
    lines = list(shadowed(tmp_path))
    assert len(lines) == len(PACKAGES)
    assert str(CHECKOUT / "sim") in lines[2]


def test_a_foreign_package_is_named_before_it_is_imported(foreign):
    done = run(["-m", "motiondeck", "--help"], foreign)
    assert (done.returncode, done.stdout) == (1, "")
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith(f"motiondeck: {foreign / 'sim'} stands in front of Motiondeck's own package 'sim'")


def test_a_foreign_module_is_named_too(tmp_path):
    (tmp_path / "hardware.py").write_text("")
    done = run(["-m", "motiondeck", "--help"], tmp_path)
    assert done.returncode == 1
    assert f"{tmp_path / 'hardware.py'} stands in front" in done.stderr


def test_a_script_beside_a_foreign_package_is_told_on_first_use(foreign):
    (foreign / "sim" / "__init__.py").write_text("")
    (foreign / "script.py").write_text("import motiondeck\nmotiondeck.load_robot('servo20')")
    done = run(["script.py"], foreign)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(f"ImportError: {foreign / 'sim'} stands in front")


def test_without_one_the_command_line_runs(tmp_path):
    done = run(["-m", "motiondeck", "--help"], tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Plays learned human motions" in done.stdout
