"""`motiondeck play --show` while an emergency stop of the show stands, with processes."""

import subprocess
import sys
from contextlib import ExitStack, closing

import pytest

from controller.wire.command_socket import CommandClient, SocketError
from controller.wire.messages.commands import EmergencyStop, GetStatus
from controller.wire.messages.replies import Accepted
from waiting import free_ports, until

pytest.importorskip("zenoh")


def asked(port, message):
    with closing(CommandClient(port)) as client:
        try:
            return client.request(message, 2.0)
        except SocketError:
            return None


@pytest.mark.thorough
def test_the_first_answer_of_a_restarted_deck_is_an_emergency_stop(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    ports = dict(zip(("left", "right"), free_ports(2), strict=True))
    with ExitStack() as opened:

        def start(name):
            options = ("walk", "--headless", "--kinematic", "--rate", "50", "--command-port", str(ports[name]))
            command = [sys.executable, "-m", "motiondeck", "play", *options, "--show", f"gala/{name}"]
            deck = subprocess.Popen(command, stdin=subprocess.DEVNULL)
            opened.callback(deck.wait)
            opened.callback(deck.kill)
            states = []
            until(lambda: states.append(asked(ports[name], GetStatus())) or states[-1] is not None, name, 30.0)
            return deck, states[-1].mode

        assert start("left")[1] == "playing"
        right, mode = start("right")
        assert mode == "playing"
        assert isinstance(asked(ports["left"], EmergencyStop()), Accepted)
        until(lambda: asked(ports["right"], GetStatus()).mode == "emergency stop", "the stop at right", 5.0)
        right.kill()
        right.wait()
        assert start("right")[1] == "emergency stop"
