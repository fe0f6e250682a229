"""The installed wheel, started in a folder that holds packages with the names of ours."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import urllib.request
import venv
from pathlib import Path

import pytest

from controller.wire.run_recording import load_recording

CHECKOUT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def command(tmp_path_factory):
    """The console script of an environment that holds the wheel; its dependencies are those of this one."""
    pytest.importorskip("hatchling", reason="the wheel is built without the network: pip install hatchling")
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)],
        cwd=CHECKOUT,
        check=True,
        capture_output=True,
    )
    (wheel,) = folder.glob("*.whl")
    venv.create(folder / "env", symlinks=True)
    python = folder / "env" / "bin" / "python"
    subprocess.run(
        [sys.executable, "-m", "pip", "-q", "--python", str(python), "install", "--no-deps", "--no-index", str(wheel)],
        check=True,
        capture_output=True,
    )
    (packages,) = folder.glob("env/lib/python*/site-packages")
    dependencies = [path for path in sys.path if path.endswith("site-packages")]
    (packages / "dependencies.pth").write_text("\n".join(dependencies))
    return folder / "env" / "bin" / "motiondeck"


@pytest.fixture(scope="module")
def crowded(tmp_path_factory):
    """A folder with packages of other people."""
    folder = tmp_path_factory.mktemp("crowded")
    for name in ("motiondeck_base", "controller", "sim", "hardware"):
        (folder / name).mkdir()
        (folder / name / "__init__.py").write_text("raise SystemExit('the wrong package was imported')")
    return folder


def environment(**more):
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | more


@pytest.mark.thorough
def test_page_recording_and_emulated_rig_work_beside_foreign_packages(command, crowded):
    deck = subprocess.Popen(
        [
            *(command, "play", "--robot", "servo20", "--rig", "emulated", "--kinematic", "--record", "show.rec"),
            *("--rate", "100", "--port", "0", "--command-port", "0", "--json"),
        ],
        cwd=crowded,
        env=environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert deck.stderr is not None
        first = deck.stderr.readline()
        assert first.startswith("page: http"), first + deck.stderr.read()
        assert answers(first.split()[1])
        until_recorded(crowded / "show.rec")
        deck.send_signal(signal.SIGTERM)
        out, errors = deck.communicate(timeout=60)
    finally:
        deck.kill()
    assert deck.returncode == 0, errors
    report = json.loads(out)
    assert (report["rig"]["joints"], report["faults"]["deck"]) == (20, 0)
    assert "has ended" not in errors
    assert load_recording(crowded / "show.rec").complete


@pytest.mark.thorough
def test_what_an_index_shows_has_no_link_that_it_cannot_follow(command):
    (file,) = command.parents[1].glob("lib/python*/site-packages/motiondeck-*.dist-info/METADATA")
    head, _, readme = file.read_text(encoding="utf-8").partition("\n\n")
    assert "docs/installation.md has extras" in readme
    assert "pip install -q motiondeck &&" in readme
    assert [words for words in ("install -q .", "[dev]", "<!--") if words in readme] == []
    assert [link for link in re.findall(r"\]\(([^)]*)\)", readme) if not link.startswith("https:")] == []
    tested = re.findall(r'"([\d.]+)"', (CHECKOUT / ".github/workflows/ci.yml").read_text().partition("python: [")[2])
    assert re.findall(r"^Classifier: Programming Language :: Python :: (\d\.\d+)$", head, flags=re.M) == tested


@pytest.mark.thorough
def test_the_examples_are_in_the_wheel(command, crowded, tmp_path):
    for words in (("examples", "start"), ("learn", "start/examples/head/nod.toml", "--out", "nod.safetensors")):
        done = subprocess.run([command, *words], cwd=tmp_path, env=environment(), capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    there = {file.relative_to(tmp_path / "start") for file in (tmp_path / "start").rglob("*") if file.is_file()}
    assert {Path("walk.bvh"), Path("configs/rigs/servo20.toml"), Path("examples/play_ten_lines.py")} <= there
    assert not any("__pycache__" in file.parts for file in there)


@pytest.mark.thorough
def test_a_foreign_package_on_the_path_is_named(command, crowded):
    done = subprocess.run(
        [command, "play"], env=environment(PYTHONPATH=str(crowded)), capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert str(crowded / "motiondeck_base") in done.stderr


@pytest.mark.thorough
def test_the_safety_envelope_is_compiled_where_there_is_a_compiler(command, crowded):
    asked = "from controller.loop.safety.compiled_envelope import *; print(load_compiled(COMPILED) is not None)"
    python = command.parent / "python"
    done = subprocess.run(
        [python, "-P", "-c", asked], cwd=crowded, env=environment(), capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == str(shutil.which("cc") is not None)


def answers(url):
    """Whether a page answers within a minute."""
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline:
        try:
            with urllib.request.urlopen(url, timeout=30) as page:
                return page.status == 200
        except OSError:
            time.sleep(0.05)
    return False


def until_recorded(path):
    """Waits until there is something in a recording."""
    deadline = time.monotonic() + 60.0
    while not path.exists() or path.stat().st_size < 5_000:
        assert time.monotonic() < deadline, "nothing is recorded"
        time.sleep(0.05)
