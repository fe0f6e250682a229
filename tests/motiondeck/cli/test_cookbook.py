"""Every recipe of docs/cookbook.md is run as it stands, with the recordings that it names: `pytest -m documented`."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bodies import waving
from controller.motion.formats.writing import bvh_text

pytestmark = [pytest.mark.documented, pytest.mark.timeout(600)]

ROOT = Path(__file__).parents[3]
PARTS = (ROOT / "docs" / "cookbook.md").read_text(encoding="utf-8").split("\n## ")[1:]
CODE = re.compile(r"^```(sh|python)\n(.*?)^```", re.M | re.S)
RECIPES = {title: CODE.findall(text) for title, _, text in (part.partition("\n") for part in PARTS)}
ELSEWHERE = {"Jaw to a voice"}  # a link to where it stands and is tested
AFTER = {
    "Nod when the doorbell rings": "Faces for a head of eight servos",
    "All my recordings on one sheet": "Cut a long recording",
}


@pytest.fixture
def kitchen(tmp_path):
    """The files that recipes start from."""
    shutil.copy(ROOT / "examples" / "walk.bvh", tmp_path / "walk.bvh")
    shutil.copytree(ROOT / "examples" / "head", tmp_path / "head")
    (tmp_path / "session.bvh").write_text(bvh_text(waving(30.0, 20.0)))
    (tmp_path / "doorbell").touch()
    return tmp_path


def cook(recipe, folder):
    """Runs the blocks of a recipe."""
    environment = os.environ | {"XDG_RUNTIME_DIR": str(folder), "MUJOCO_GL": "egl", "PYTHONPATH": str(ROOT)}
    environment["PATH"] = f"{Path(sys.executable).parent}:{environment['PATH']}"
    for language, text in RECIPES[recipe]:
        words = ["bash", "-euc", text] if language == "sh" else [sys.executable, "-c", text]
        done = subprocess.run(
            words, cwd=folder, env=environment, capture_output=True, text=True, timeout=500, stdin=subprocess.DEVNULL
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert "Traceback" not in done.stderr


@pytest.mark.parametrize("recipe", sorted(RECIPES.keys() - ELSEWHERE))
def test_a_recipe_does_what_it_says(recipe, kitchen):
    assert RECIPES[recipe], "a recipe has something to run"
    if recipe in AFTER:
        cook(AFTER[recipe], kitchen)
    cook(recipe, kitchen)
    if "doorbell" in recipe:
        assert not (kitchen / "doorbell").exists()
