"""The progress line of a run, written by a thread: a terminal that blocks must not delay the loop."""

import shutil
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

from controller.loop.stop_requests import StopRequest
from controller.wire.messages.blends import described
from controller.wire.messages.deck_snapshot import DeckState

PERIOD = 0.25  # s
_MODES = {"home": "at home", "held": "held", "emergency stop": "EMERGENCY STOP"}


def words_of(deck: DeckState, stop: StopRequest, seconds: float | None) -> str:
    """The line: what is played, for how long, and when or how it ends."""
    if stop:
        return f"{stop.reason}: the joints come to rest"
    if stop.mode != "playing":
        return f"{_MODES[stop.mode]}: {deck.playing}, Ctrl-C ends it"
    if deck.time < PERIOD:  # its first update comes before the approach
        return f"approaching the first pose of {deck.playing}"
    going = "" if deck.settled else " (on its way)"
    until = f" of {seconds:.0f} s" if seconds is not None else " s, Ctrl-C ends it"
    return f"{described(deck.playing, deck.blend)}{going}  {deck.time:.0f}{until}"


@contextmanager
def progress_line(
    deck: DeckState, stop: StopRequest, seconds: float | None, *, prompt: bool, stream: TextIO | None = None
) -> Iterator[None]:
    """Shows the line in the block, if the stream is a terminal; with a prompt in its place only the end is shown."""
    out = sys.stderr if stream is None else stream
    if not out.isatty():
        yield
        return
    over = threading.Event()
    line = threading.Thread(target=_show, args=(deck, stop, seconds, prompt, out, over.wait), daemon=True)
    line.start()
    try:
        yield
    finally:
        over.set()
        line.join(1.0)


def _show(
    deck: DeckState, stop: StopRequest, seconds: float | None, prompt: bool, out: TextIO, wait: Callable[[float], bool]
) -> None:
    shown = ""
    with suppress(OSError, ValueError):  # a terminal that has gone
        while not wait(PERIOD):
            words = words_of(deck, stop, seconds)
            if words == shown or (prompt and not stop):
                continue
            shown = words
            width = shutil.get_terminal_size().columns - 1
            # The cursor goes back to the start, so that what others print replaces the line.
            out.write(f"\n{words}\n" if prompt else f"\r\x1b[K{words[:width]}\r")
            out.flush()
            if prompt:
                return
        if shown and not prompt:
            out.write("\x1b[K")
            out.flush()
