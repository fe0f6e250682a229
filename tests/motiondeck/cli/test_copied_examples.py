"""`motiondeck examples`: a folder to start from, whose commands run as they are printed."""

import json
import re
import runpy
import shlex
from pathlib import Path

import pytest

from command_line import motiondeck

ROOT = Path(__file__).parents[3]


@pytest.fixture
def copied(tmp_path, monkeypatch):
    """The folder, which is the working directory then, and what was printed."""
    monkeypatch.chdir(tmp_path)
    run = motiondeck("examples", "start")
    assert run.returncode == 0, run.stderr
    monkeypatch.chdir(tmp_path / "start")
    return Path(), run.stdout


def test_it_holds_what_the_pages_name_but_no_network_and_no_cache(copied):
    folder, _ = copied
    mentioned = {
        word
        for page in (*(ROOT / "docs").glob("*.md"), ROOT / "README.md")
        for word in re.findall(r"(?:examples|configs)/[\w./-]+", page.read_text(encoding="utf-8"))
    }
    assert "configs/rigs/servo20.toml" in mentioned
    assert {word for word in mentioned if not (folder / word).exists()} == set()
    assert [file for file in folder.rglob("*") if file.suffix == ".safetensors" or file.name == "__pycache__"] == []


def test_a_folder_with_something_in_it_is_left_as_it_is(copied, tmp_path):
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    for there in (tmp_path / "start", tmp_path / "start" / "walk.bvh"):
        run = motiondeck("examples", there)
        assert run.returncode == 1
        assert run.stderr == f"motiondeck: {there}: is there already. Name a new folder; nothing is replaced\n"
    assert {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()} == before


def test_the_walk_is_a_recording_without_doubts(copied):
    told = json.loads(motiondeck("clip", "show", "walk.bvh", "--json").stdout)
    assert told["doubts"] == []
    assert told["lacks"] == []


def test_the_walk_is_what_its_script_makes():
    made = runpy.run_path(str(ROOT / "docs" / "sample_walk.py"))["text"]()
    assert (ROOT / "examples" / "walk.bvh").read_text() == made


@pytest.mark.thorough
def test_what_it_offers_runs(copied):
    _, printed = copied
    lines = [line.partition("   ")[0] for line in re.findall(r"^  ((?:motiondeck|python) .*)", printed, flags=re.M)]
    assert len(lines) == 4
    for line in lines:
        program, *words = shlex.split(line.replace(" --play", " --out walk.safetensors"))
        if words[0] == "play":
            words += ["--headless", "--seconds", "1", "--command-port", "0"]
        if program == "motiondeck":
            run = motiondeck(*words)
            assert run.returncode == 0, run.stderr
        else:
            assert Path(words[0]).is_file()  # run by test_examples
