"""`motiondeck conduct`, `fleet certificates` and `play --show`: a whole show, and mistakes in one line."""

import json
import os
import socket
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from unittest.mock import Mock

import pytest

from command_line import motiondeck
from motiondeck.cli.show.conduct import ShowPage, carry_out, receive_from_page
from motiondeck.shows.conductor import Conductor
from motiondeck.shows.show_file import Show, ShowCue
from motiondeck.shows.show_state import ShowNotice

pytest.importorskip("zenoh")

SHOW = """
show = "gala"
[[cues]]
when = "here"
say = "switch jog"
in_step = true
"""


@pytest.mark.thorough
def test_a_show_of_one_deck_from_its_first_cue_to_the_stop(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    (tmp_path / "gala.toml").write_text(SHOW)
    command = [sys.executable, "-m", "motiondeck"]
    options = ("walk", "--headless", "--kinematic", "--rate", "50", "--command-port", "0", "--seconds", "60")
    deck = subprocess.Popen([*command, "play", *options, "--show", "gala/left"], stderr=subprocess.PIPE, text=True)
    conductor = subprocess.Popen(
        [*command, "conduct", "gala.toml", "--headless"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path.cwd())},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        for line in conductor.stdout:
            if "cue 1: left" in line:
                break
        conductor.stdin.write("left stop\n")
        conductor.stdin.flush()
        for line in conductor.stdout:
            if "left is gone" in line:
                break
        conductor.stdin.write("quit\n")
        conductor.stdin.close()
        assert conductor.wait() == 0
        assert deck.wait() == 0
    finally:
        for process in (conductor, deck):
            process.kill()
            process.wait()


def test_a_button_of_the_page_does_what_the_typed_word_does():
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    page, conductor, told = ShowPage(ours), Mock(), []
    conductor.go.return_value = "the show does not wait for go"
    with ours, theirs:
        theirs.send(b"stop")
        theirs.send(b"go")
        assert receive_from_page(conductor, page, told.append)
        assert [call[0] for call in conductor.method_calls] == ["stop", "go"]
        assert told == ["the show does not wait for go"]
        assert b"does not wait" in theirs.recv(1000)
        page.show(ShowNotice("which the page does not read any more"))
        theirs.close()
        assert not receive_from_page(conductor, page, told.append)
        assert told[1:] == ["the page has ended; the show goes on"]
        page.show(ShowNotice("which nobody reads"))


def conducted(told, *cues, **show):
    """A conductor without decks."""
    return Conductor(Show("gala", list(cues), decks=["left"], groups={"sides": ["left"]}, **show), Mock(), told.append)


@pytest.mark.parametrize(
    ("typed", "says"),
    [
        ("tempo 1.2", "for which decks? For example: all tempo 1.2"),
        ("pause", "for which decks? For example: all pause"),
        ("left", "what is left to do? For example: left pause"),
        ("sides,left", "what is sides,left to do? For example: sides,left pause"),
        ("lft pause", "unknown deck 'lft'. Did you mean left?"),
        ("gooo", "'gooo' is nothing to do here: go | hold"),
        ("left pause", "not here: left"),
        ("hold", "waits for go: cue 1"),
    ],
)
def test_what_is_typed_wrongly_is_answered_with_an_example(typed, says):
    told = []
    with closing(conducted(told, ShowCue(say="home", at=3600.0))) as conductor:
        assert carry_out(conductor, typed, told.append, as_json=False)
    assert len(told) == 1
    assert told[0].startswith(says)


def test_the_status_says_where_the_show_is_and_the_end_what_decks_do(capsys):
    told = []
    with closing(conducted(told, ShowCue(say="home", name="bow", hold=True))) as conductor:
        conductor.step()
        assert carry_out(conductor, "status", told.append, as_json=False)
        assert capsys.readouterr().out.splitlines()[0].strip() == 'HELD before "bow"; Go brings it'
        assert carry_out(conductor, "status", told.append, as_json=True)
        assert json.loads(capsys.readouterr().out) == {
            "present": None,
            "upcoming": "bow",
            "seconds": None,
            "waits": True,
            "stopped_by": "",
            "decks": {},
        }
        told.clear()
        assert not carry_out(conductor, "quit", told.append, as_json=False)
    assert told == ["ended; after 3 s without a conductor decks pause until one is there (if_lost)"]


def test_mistakes_are_one_line(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    (tmp_path / "gala.toml").write_text(SHOW.replace("jog", "jog twice and more"))
    wrong = motiondeck("conduct", tmp_path / "gala.toml")
    assert (wrong.returncode, wrong.stderr.count("\n")) == (1, 1)
    assert "gala.toml: cue 1: switch:" in wrong.stderr
    (tmp_path / "gala.toml").write_text(SHOW)
    monkeypatch.setattr("motiondeck.cli.show.conduct._STOP_WITHIN", 0.2)
    alone = motiondeck("conduct", tmp_path / "gala.toml", "--stop")
    assert (alone.returncode, alone.stderr) == (1, "motiondeck: no deck of the show is reached\n")
    nowhere = motiondeck("play", "--headless", "--show", "gala")
    assert nowhere.returncode == 1
    assert "give SHOW/DECK" in nowhere.stderr
