"""The process of the page of a show (`python -m motiondeck.page.show.viewer`); `motiondeck conduct` starts it.

Its standard input is a connected socket: the conductor tells it states and notices, and hears words, as if typed.
"""

import argparse
import os
import select
import socket
import sys
import time
from contextlib import ExitStack, redirect_stdout
from pathlib import Path

import msgspec

from motiondeck.page.show.show_view import ShowView
from motiondeck.page.web.private_page import PrivatePage
from motiondeck.shows.show_state import ShowNotice, ShowState
from motiondeck_base.errors import MotiondeckError

SILENT_AFTER = 2.0  # s without a word of the conductor
LAST_WORD = 1.2  # s for a browser to get the end
_MOST_BYTES = 1 << 20

_news = msgspec.json.Decoder(ShowState | ShowNotice)


def view(conductor: socket.socket, port: int) -> None:
    """Shows a show until its conductor is gone; prints the page's address. MotiondeckError if the port is taken."""
    page = PrivatePage(port, label="Motiondeck · show")
    print(f"page: {page.address}", file=sys.stderr, flush=True)
    shown = ShowView(page, lambda word: _send(conductor, word))
    heard = time.monotonic()
    try:
        while True:
            if not select.select([conductor], [], [], 0.5)[0]:
                if (silent := time.monotonic() - heard) > SILENT_AFTER:
                    shown.silent(silent)
                continue
            if not (data := _receive(conductor)):
                break
            heard = time.monotonic()
            news = _news.decode(data)
            if isinstance(news, ShowState):
                shown.show(news)
            else:
                shown.notify(news.text)
        shown.end()
        page.flush()
        time.sleep(LAST_WORD if page.get_clients() else 0.0)
    finally:
        page.stop()


def _receive(conductor: socket.socket) -> bytes:
    """What the conductor says next; nothing when it is gone."""
    try:
        return conductor.recv(_MOST_BYTES)
    except ConnectionResetError:  # it was killed, and has not read a word
        return b""


def _send(conductor: socket.socket, word: str) -> None:
    """Says a word without waiting: a conductor that takes none is to be known at once."""
    conductor.send(word.encode(), socket.MSG_DONTWAIT)


def main(arguments: list[str] | None = None) -> int:
    """The command line of this process; returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m motiondeck.page.show.viewer", description="Shows a show in the browser."
    )
    parser.add_argument("--port", type=int, required=True, help="where to serve the page, on loopback")
    options = parser.parse_args(arguments)
    try:
        # viser announces itself on standard output, which belongs to the conductor.
        with ExitStack() as opening:
            conductor = opening.enter_context(socket.socket(fileno=os.dup(0)))
            opening.enter_context(redirect_stdout(opening.enter_context(Path(os.devnull).open("w"))))
            view(conductor, options.port)
    except MotiondeckError as error:
        print(f"motiondeck: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
