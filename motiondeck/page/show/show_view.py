"""The page of a show: the state line, the emergency stop, go and hold, and below them the decks and the cues."""

from collections.abc import Callable
from pathlib import Path

import viser

from motiondeck.page.show.show_text import cue_table, deck_cards, ended_show_line, show_line, silent_line
from motiondeck.page.web.page_style import CURRENT, NOTICE_SECONDS, STOPS, STYLE, buttons_in_line, style_in
from motiondeck.page.web.private_page import PrivatePage
from motiondeck.shows.show_state import ShowState

WIDTH = 760  # pixels
GO = (43, 138, 62)

SHOW_STYLE = style_in(Path(__file__).with_name("show.css"))


class ShowView:
    """All that is on the page of a show; `say` sends a word to the conductor, and raises an OSError if it is gone."""

    def __init__(self, page: PrivatePage, say: Callable[[str], None]) -> None:
        self._page, self._say = page, say
        gui = page.gui
        gui.configure_theme(show_share_button=False, show_logo=False, brand_color=CURRENT)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH)
        gui.add_html(STYLE + buttons_in_line(2) + SHOW_STYLE)
        self._line = gui.add_html("")
        stop = gui.add_button(
            "Emergency stop", icon=viser.Icon.ALERT_OCTAGON, color=STOPS, hint="Of all decks. Key: Esc."
        )
        go = gui.add_button("Go", icon=viser.Icon.PLAYER_PLAY, color=GO, hint="Passes a hold point.")
        hold = gui.add_button("Hold", icon=viser.Icon.HAND_STOP, color="gray", hint="No more cues until Go.")
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
        self._line.content = show_line(state).as_html()
        self._decks.content = deck_cards(state)
        self._cues.content = cue_table(state)

    def silent(self, seconds: float) -> None:
        """Shows that the conductor has been silent for some seconds."""
        self._line.content = silent_line(self._show, seconds).as_html()

    def notify(self, text: str, *, alarming: bool = False) -> None:
        """Shows a notice in every browser."""
        for client in self._page.get_clients().values():
            client.add_notification(
                "Show", text, auto_close_seconds=NOTICE_SECONDS, color="red" if alarming else "blue"
            )

    def end(self) -> None:
        """Shows that the conductor is gone; nothing can be said any more."""
        self._line.content = ended_show_line().as_html()
        for button in self._buttons.values():
            button.disabled = True
