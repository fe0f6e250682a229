"""`motiondeck play --show` and `conduct` while an emergency stop of the show stands, with processes."""

import json
import os
import signal
import subprocess
import sys
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from controller.wire.command_socket import CommandClient, SocketError
from controller.wire.messages.commands import EmergencyStop, GetStatus
from controller.wire.messages.replies import Accepted
from waiting import free_ports, tried, until

pytest.importorskip("zenoh")


def asked(port, message):
    with closing(CommandClient(port)) as client:
        try:
            return client.request(message)
        except SocketError:
            return None


class Stage:
    """Decks of a show as processes, and its conductor."""

    def __init__(self, opened, folder):
        self.opened, self.ports = opened, dict(zip(("left", "right"), free_ports(2), strict=True))
        self.file, self.conductor, self.said = folder / "gala.toml", None, folder / "said"
        self.file.write_text('show = "gala"\ndecks = ["left", "right"]')

    def run(self, *words, **pipes):
        process = subprocess.Popen([sys.executable, "-m", "motiondeck", *map(str, words)], text=True, **pipes)
        self.opened.callback(process.wait)
        self.opened.callback(process.kill)
        return process

    def start(self, name):
        """A deck, and the mode of its first answer."""
        options = ("walk", "--headless", "--kinematic", "--rate", "50", "--command-port", self.ports[name])
        deck, states = self.run("play", *options, "--show", f"gala/{name}", stdin=subprocess.DEVNULL), []
        until(lambda: states.append(asked(self.ports[name], GetStatus())) or states[-1] is not None, name)
        return deck, states[-1].mode

    def conduct(self):
        out = self.opened.enter_context(self.said.open("w"))
        self.conductor = self.run("conduct", self.file, "--headless", "--json", stdin=subprocess.PIPE, stdout=out)
        until(lambda: sum(" is here: " in text for _, text in self.lines()) == 2, "both decks at the conductor")

    def lines(self):
        said = [json.loads(line) for line in self.said.read_text().splitlines()]
        return [(line["at"], line["text"]) for line in said]

    def says_soon(self, report):
        """Whether that is said first of a stop that is given now, within half a second."""
        before = len(self.lines())
        self.conductor.stdin.write("stop\n")
        self.conductor.stdin.flush()

        def said(begin):
            return next((line for line in self.lines()[before:] if line[1].startswith(begin)), None)

        at, text = until(lambda: said("the emergency stop has"), "a report")
        return text == report and at - said("emergency stop by")[0] < 0.5


@pytest.fixture
def stage(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with ExitStack() as opened:
        yield Stage(opened, tmp_path)


def member_of(deck):
    """The process through which a deck takes part."""
    children = Path(f"/proc/{deck.pid}/task/{deck.pid}/children").read_text().split()
    return next(int(child) for child in children if "member_process" in Path(f"/proc/{child}/cmdline").read_text())


@pytest.mark.thorough
def test_the_first_answer_of_a_restarted_deck_is_an_emergency_stop(stage):
    assert stage.start("left")[1] == "playing"
    right, mode = stage.start("right")
    assert mode == "playing"
    assert isinstance(asked(stage.ports["left"], EmergencyStop()), Accepted)
    until(lambda: asked(stage.ports["right"], GetStatus()).mode == "emergency stop", "the stop at right")
    right.kill()
    right.wait()
    assert stage.start("right")[1] == "emergency stop"


@pytest.mark.thorough
def test_it_is_said_within_half_a_second_which_decks_have_stopped(stage):
    stage.start("left")
    right, _ = stage.start("right")
    stage.conduct()
    # A busy machine may be late now and then.
    until(lambda: stage.says_soon("the emergency stop has reached left, right"), "that it has reached both")
    member = member_of(right)
    stage.opened.callback(os.kill, member, signal.SIGKILL)
    os.kill(member, signal.SIGSTOP)
    until(lambda: stage.says_soon("the emergency stop has not reached right"), "that it has not reached right")

    def stop_all():
        stop = stage.run("conduct", stage.file, "--stop", stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        said, wrong = stop.communicate()
        assert said.splitlines() == ["left: emergency stop", "not stopped yet: right"]
        assert (stop.returncode, wrong) == (1, "motiondeck: no emergency stop is reported by: right\n")

    tried(stop_all)
