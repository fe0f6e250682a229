"""`motiondeck play` starts itself again with another library: which command line that is."""

import sys

import pytest
import typer.main

from benchmarks.stop.hostile import running_deck
from controller.wire.messages.commands import EmergencyStop, LoadLibrary
from controller.wire.messages.replies import Accepted
from motiondeck.cli.main import command_line
from motiondeck.cli.play import play_again
from motiondeck_base.shipped import find_library


@pytest.fixture
def started(monkeypatch):
    """The command lines that replace this process."""
    lines: list[list[str]] = []
    monkeypatch.setattr("os.execv", lambda program, words: lines.append(words))
    return lines


def again(words, motion="jog"):
    app = typer.main.get_command(command_line(["play"])).commands["play"]
    context = app.make_context("play", words)
    play_again(context, "thesis15", str(find_library("thesis15")), motion, page_port=8040, command_port=47810)


def test_options_are_kept_and_what_was_played_is_not(started):
    again(["walk", "--robot", "servo20", "--kinematic", "--root", "gantry", "--rate", "100", "--port", "0"])
    begin = [sys.executable, "-P", "-m", "motiondeck", "play", "--library", str(find_library("thesis15")), "jog"]
    kept = ["--robot", "servo20", "--rate", "100.0", "--kinematic", "--root", "gantry"]
    assert started == [[*begin, *kept, "--command-port", "47810", "--port", "8040"]]


def test_each_of_several_outputs_is_kept(started):
    again(["--output", "arm:left", "--output", "log"])
    assert started[0][8:] == ["--output", "arm:left", "--output", "log", "--command-port", "47810", "--port", "8040"]


def test_of_a_motion_that_the_library_lacks_the_run_before_goes_on(started, capsys):
    again(["--library", "thesis15"], "tango")
    assert started[0][5:7] == ["--library", "thesis15"]
    assert "no motion 'tango'" in capsys.readouterr().err


def test_after_an_emergency_stop_nothing_starts_again_by_itself():
    load = LoadLibrary(str(find_library("thesis15")), "jog")
    with running_deck("walk", "--port", "0") as (deck, client, said):
        assert isinstance(client.request(load), Accepted)
        assert isinstance(client.request(EmergencyStop()), Accepted)
        assert deck.wait() == 1
        assert "the emergency stop is on, so jog is not started" in said.read_text()
