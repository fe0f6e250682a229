"""`motiondeck send` to a deck on another machine that does not answer."""

import socket
import threading
from contextlib import closing
from types import SimpleNamespace

import pytest

from command_line import motiondeck
from controller.wire import network_transport


@pytest.fixture
def options(tmp_path):
    token = tmp_path / "token"
    token.write_text("0123456789abcdef" * 4)
    token.chmod(0o600)
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as silent:
        silent.bind(("127.0.0.1", 0))
        yield ("--host", "127.0.0.1", "--command-port", silent.getsockname()[1], "--token-file", token)


@pytest.mark.parametrize(("command", "lines"), [("estop", 2), ("pause", 1)])
def test_an_emergency_stop_that_is_not_acknowledged_is_said_before_it_is_given_up(options, command, lines, monkeypatch):
    shown = threading.Event()

    def show(*words, **to):
        print(*words, **to)
        shown.set()

    if command == "estop":  # it is given up when the thread that says so has got a core
        monkeypatch.setattr("motiondeck.cli.remote.send.print", show, raising=False)
        clock = SimpleNamespace(monotonic=lambda: 1e9 if shown.is_set() else 0.0)
        monkeypatch.setattr(network_transport, "time", clock)
    else:
        monkeypatch.setattr(network_transport, "_ANSWERS_WITHIN", 0.1)
    done = motiondeck("send", command, *options)
    said = done.stderr.splitlines()
    assert (done.returncode, len(said)) == (1, lines)
    assert "no deck replies at 127.0.0.1" in said[-1]
    assert command == "pause" or "the emergency stop is not acknowledged yet; it is sent on" in said[0]
