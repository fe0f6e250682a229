"""Emergency stops over a network that loses datagrams.

A deck without a rig plays, and stops come from another address through a relay that loses a part of the datagrams each
way; each is reset before the next. A stop counts where the deck's own socket says that it is on within 1 s, and
separately where its sender was answered. Times are from the first datagram on, ms.
"""

from __future__ import annotations

import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks.command import run
from benchmarks.stop.surroundings import LossyNetwork
from controller.wire.command_socket import CommandClient, SocketError
from controller.wire.messages import commands
from controller.wire.messages.replies import Accepted, State

_BAR = 1.0  # s


def is_stopped(deck: CommandClient) -> bool:
    """Whether a deck's emergency stop is on, by its own socket."""
    state = deck.request(commands.GetStatus(), 5.0)
    return isinstance(state, State) and state.mode == "emergency stop"


def release(deck: CommandClient) -> None:
    """Resets a deck, and lets it play."""
    while not isinstance(deck.request(commands.Reset(), 5.0), Accepted):
        time.sleep(0.02)
    deck.request(commands.Resume(), 5.0)


def wait_for(deck: CommandClient) -> None:
    """Waits until a deck answers."""
    until = time.monotonic() + 60.0
    while True:
        try:
            deck.request(commands.GetStatus(), 5.0)
            return
        except SocketError:
            if time.monotonic() > until:
                raise
            time.sleep(0.1)


def main(
    stops: Annotated[int, typer.Option(help="How many.")] = 200,
    loss: Annotated[float, typer.Option(help="The part of the datagrams that is lost, each way.")] = 0.2,
) -> int:
    """Emergency stops over a network that loses datagrams."""
    with tempfile.TemporaryDirectory() as folder:
        token = Path(folder) / "token"
        token.touch(0o600)
        token.write_text("a secret of these runs 0123456789")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            port = int(probe.getsockname()[1])
        play = ["play", "walk", "--headless", "--command-port", str(port)]
        listen = ["--listen", "127.0.0.1", "--token-file", str(token)]
        program = [sys.executable, "-m", "motiondeck", *play, *listen]
        with subprocess.Popen(program, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            deck, network = CommandClient(port), LossyNetwork(port, loss)
            wait_for(deck)
            arrived, answered = list[float](), list[float]()
            for _ in range(stops):
                if is_stopped(deck):
                    release(deck)
                client = CommandClient(network.port, "127.0.0.1", token.read_bytes())
                began = time.monotonic()
                try:
                    client.request(commands.EmergencyStop(), _BAR)
                    answered.append(time.monotonic() - began)
                except SocketError:
                    pass
                client.close()
                if is_stopped(deck):
                    arrived.append(time.monotonic() - began)
            network.close()
            process.terminate()
    p50, worst = 1e3 * np.median(answered), 1e3 * max(answered)
    print(f"{len(arrived)} of {stops} stops arrived, {len(answered)} answered within {_BAR:g} s")
    print(f"answered after p50 {p50:.0f}, worst {worst:.0f} ms; {loss:.0%} lost each way")
    return 0 if len(arrived) == stops else 1


if __name__ == "__main__":
    sys.exit(run("lossy_stops", main))
