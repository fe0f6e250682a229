"""The process of the page of a show (`python -m motiondeck.page.show.viewer`); `motiondeck conduct` starts it.

Its standard input is a connected socket: the conductor tells it states and notices, and hears words, as if typed.
"""

import os
import select
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path

import msgspec
import viser

from motiondeck.page.alarms import Notices
from motiondeck.page.operate import CommandButton, Operate
from motiondeck.page.show.show_text import ENDED, cue_rows, cue_table, deck_cards, doing, show_line, silent_line
from motiondeck.page.web.page_style import QUIET, STOPS, STYLE, style_in
from motiondeck.page.web.parts import PageParts
from motiondeck.page.web.private_page import PrivatePage, served
from motiondeck.shows.show_state import ShowNotice, ShowState
from motiondeck_base.errors import MotiondeckError

WIDTH = 760  # pixels
GO = (43, 138, 62)
BUTTONS = [CommandButton("Go", [["go"]]), CommandButton("Hold", [["hold"]])]
SHOW_STYLE = style_in(Path(__file__).with_name("show.css"))


class ShowView:
    """All that is on the page of a show; `say` sends a word to the conductor, and raises an OSError if it is gone."""

    def __init__(self, page: PrivatePage, say: Callable[[str], object]) -> None:
        self._say = say
        gui = page.gui
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH)
        gui.add_html(STYLE + SHOW_STYLE)
        parts = PageParts(page)
        self._notices, self._operate = Notices(parts), Operate(parts, {}, lambda words: self.say(words[0]))
        self._line = gui.add_html("")
        icons = viser.Icon
        stop = gui.add_button("Emergency stop", icon=icons.ALERT_OCTAGON, color=STOPS, hint="Of all decks. Key: Esc.")
        go = gui.add_button("Go", icon=icons.PLAYER_PLAY, color=GO, hint="Passes a hold point.")
        hold = gui.add_button("Hold", icon=icons.HAND_STOP, color=QUIET, hint="No more cues until Go.")
        self._buttons = {"stop": stop, "go": go, "hold": hold}
        for word, button in self._buttons.items():
            button.on_click(lambda _, word=word: self.say(word))
        gui.add_command("Emergency stop", hotkey="escape").on_trigger(lambda _: self.say("stop"))
        self._decks, self._cues = gui.add_html(""), gui.add_html("")
        self._show = ""
        self.silent(0.0)

    def say(self, word: str) -> None:
        """Says a word to the conductor; shows a notice where that cannot be done."""
        try:
            self._say(word)
        except OSError:
            self.notify(f"'{word}' has not reached the conductor", alarming=True)

    def show(self, state: ShowState) -> None:
        """Shows how the show stands."""
        self._show = state.show
        decks = [(deck.name, *doing(deck)) for deck in state.decks]
        self._line.content = self._operate.show(show_line(state), BUTTONS, cue_rows(state), decks=decks)
        self._notices.show()
        self._decks.content = deck_cards(state)
        self._cues.content = cue_table(state)

    def silent(self, seconds: float) -> None:
        """Shows that the conductor has been silent for some seconds."""
        self._line.content = self._operate.show(silent_line(self._show, seconds), BUTTONS)

    def notify(self, text: str, *, alarming: bool = False) -> None:
        """Shows a notice in every browser."""
        self._notices.add("Show", text, alarming=alarming)

    def end(self) -> None:
        """Shows that the conductor is gone; nothing can be said any more."""
        self._line.content = self._operate.show(ENDED, [])
        for button in self._buttons.values():
            button.disabled = True


SILENT_AFTER = 2.0  # s without a word of the conductor
_MOST_BYTES = 1 << 20

_news = msgspec.json.Decoder(ShowState | ShowNotice)


def view(conductor: socket.socket, port: int) -> None:
    """Shows a show until its conductor is gone; prints the page's address. MotiondeckError if the port is taken."""
    with served(port, "Motiondeck · show") as page:
        print(f"page: {page.address}", file=sys.stderr, flush=True)
        # A conductor that takes no word is to be known at once.
        shown = ShowView(page, lambda word: conductor.send(word.encode(), socket.MSG_DONTWAIT))
        heard = time.monotonic()
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


def _receive(conductor: socket.socket) -> bytes:
    """What the conductor says next; nothing when it is gone."""
    try:
        return conductor.recv(_MOST_BYTES)
    except ConnectionResetError:  # it was killed, and has not read a word
        return b""


def main(port: str) -> int:
    """The command line of this process: where to serve the page, on loopback; returns its exit code."""
    try:
        with socket.socket(fileno=os.dup(0)) as given:
            view(given, int(port))
    except MotiondeckError as error:
        print(f"motiondeck: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
