"""What is learned and played from the page of keyframes ends when it is to, whatever it is doing."""

import sys

import pytest

from motiondeck.page.keys import keys_page
from motiondeck.page.keys.keys_page import Rehearsal
from waiting import until

COMMANDS = """
import pathlib, sys, time
folder = pathlib.Path(sys.argv[1])
(folder / sys.argv[2]).touch()
time.sleep(float((folder / (sys.argv[2] + ".s")).read_text()))
"""


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A rehearsal whose commands only say that they have begun, and last as long as files say."""
    for name, seconds in (("learn.s", 0.0), ("play.s", 600.0)):
        (tmp_path / name).write_text(str(seconds))
    monkeypatch.setattr(keys_page, "_COMMAND", [sys.executable, "-c", COMMANDS, str(tmp_path)])
    return Rehearsal(tmp_path / "wave.toml", "rig.toml")


@pytest.mark.parametrize("end", ["stop", "end"])
def test_nothing_plays_after_it_was_stopped_while_it_learned(run, tmp_path, end):
    (tmp_path / "learn.s").write_text("60")
    run.start(emulated=True)
    until((tmp_path / "learn").exists, "the learning")
    getattr(run, end)()
    until(lambda: not run.busy, "its end")
    assert run.said == "stopped"
    assert not (tmp_path / "play").exists()


def test_what_plays_ends(run, tmp_path):
    run.start(emulated=True)
    until((tmp_path / "play").exists, "the run")
    run.end()
    assert not run.busy


def test_it_starts_again_after_a_stop(run, tmp_path):
    run.stop()
    run.start(emulated=True)
    until((tmp_path / "play").exists, "the run")
    run.end()
