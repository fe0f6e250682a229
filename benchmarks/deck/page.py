"""What the page sends and costs with 0, 1 and 3 browsers.

A browser here is a connection that takes what the page sends and draws nothing, because a real one would use up this
machine; it says where its camera is, as a real one does at first. Bytes are those of the websocket's payload, which
viser has compressed; a message is a frame of it, of which viser makes at most one in a sixtieth of a second. CPU is
that of the whole process, user and system, in per cent of a core, after the page has settled. What a browser gets at
first (meshes, widgets, pictures) is counted apart.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.command import run

CLOCK_TICKS = os.sysconf("SC_CLK_TCK")
SETTLES = 4.0  # s until all that a browser gets at first has arrived
CAMERA = {  # what viser's own page says first
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (1.0, 0.0, 0.0),
    "fov": 1.0,
    "near": 0.1,
    "far": 10.0,
    "image_height": 768,
    "image_width": 1366,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}
ASKED = {"page_percent": 10.0, "kilobytes_per_s": 150.0}


class Browser:
    """A connection to a page that counts what it gets."""

    def __init__(self, port: int) -> None:
        import msgspec
        import viser
        import websockets.sync.client

        self.bytes = self.messages = 0
        self._link = websockets.sync.client.connect(
            f"ws://127.0.0.1:{port}",
            subprotocols=[websockets.Subprotocol(f"viser-v{viser.__version__}")],
            origin=websockets.Origin(f"http://127.0.0.1:{port}"),
            max_size=None,
            compression=None,
        )
        self._link.send(msgspec.msgpack.encode(CAMERA))
        threading.Thread(target=self._take, daemon=True).start()

    def _take(self) -> None:
        with contextlib.suppress(Exception):  # the page has ended
            for frame in self._link:
                self.bytes += len(frame)
                self.messages += 1

    def close(self) -> None:
        """Leaves the page."""
        self._link.close()


def cpu_seconds(pid: int) -> float:
    """What a process has used so far, user and system, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / CLOCK_TICKS


def page_of(deck: int) -> int:
    """The process of a deck's page."""
    for task in Path(f"/proc/{deck}/task").iterdir():
        for child in (task / "children").read_text().split():
            if b"motiondeck.page.viewer" in Path(f"/proc/{child}/cmdline").read_bytes():
                return int(child)
    raise RuntimeError("the deck has no page")


def measure(deck: int, port: int, browsers: int, seconds: float) -> dict[str, float]:
    """One row, with so many browsers for some seconds."""
    page, open_ones = page_of(deck), [Browser(port) for _ in range(browsers)]
    time.sleep(SETTLES)
    first = sum(one.bytes for one in open_ones)
    messages = sum(one.messages for one in open_ones)
    used, began = (cpu_seconds(page), cpu_seconds(deck)), time.monotonic()
    time.sleep(seconds)
    passed = time.monotonic() - began
    row = {
        "browsers": browsers,
        "kilobytes_per_s": (sum(one.bytes for one in open_ones) - first) / passed / 1e3 / max(browsers, 1),
        "messages_per_s": (sum(one.messages for one in open_ones) - messages) / passed / max(browsers, 1),
        "page_percent": 100.0 * (cpu_seconds(page) - used[0]) / passed,
        "deck_percent": 100.0 * (cpu_seconds(deck) - used[1]) / passed,
        "first_kilobytes": first / 1e3 / max(browsers, 1),
    }
    for one in open_ones:
        one.close()
    time.sleep(0.5)
    return row


def main(
    seconds: Annotated[float, typer.Option(help="How long each row is measured, s.")] = 10.0,
    robot: Annotated[str, typer.Option(help="Who plays.")] = "mannequin",
    rig: Annotated[str, typer.Option(help="'emulated' for servos too, with their cards.")] = "",
    motion: Annotated[str, typer.Option(help="What is played.")] = "walk",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Bytes and messages a second a browser, and CPU of the page's process and of the deck."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    servos = ["--rig", rig] if rig else []
    command = [sys.executable, "-P", "-m", "motiondeck", "play", motion, "--robot", robot, *servos]
    deck = subprocess.Popen(
        [*command, "--port", str(port), "--command-port", "0"], stdin=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    try:
        assert deck.stderr is not None
        deck.stderr.readline()
        time.sleep(SETTLES)
        rows = [measure(deck.pid, port, browsers, seconds) for browsers in (0, 1, 3)]
    finally:
        deck.terminate()
        deck.communicate()
    if as_json:
        print(json.dumps({"robot": robot, "rig": rig, "rows": rows, "asked": ASKED}))
        return
    print(f"{'browsers':>8} {'kB/s each':>10} {'messages/s':>11} {'page, %':>8} {'deck, %':>8} {'at first, kB':>13}")
    for row in rows:
        print(
            f"{row['browsers']:>8} {row['kilobytes_per_s']:>10.0f} {row['messages_per_s']:>11.1f} "
            f"{row['page_percent']:>8.1f} {row['deck_percent']:>8.1f} {row['first_kilobytes']:>13.0f}"
        )


if __name__ == "__main__":
    run("page", main, __doc__)
