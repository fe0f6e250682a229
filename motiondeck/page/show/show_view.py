"""The page of a show: the state line, the emergency stop, go and hold, and below them the decks and the cues."""

from __future__ import annotations

from collections.abc import Callable

import viser

from motiondeck.page.show.show_text import cue_table, deck_cards, ended_show_line, show_line, silent_line
from motiondeck.page.web.page_style import CURRENT, NOTICE_SECONDS, STATE_LINE, STOPS, STYLE, buttons_in_line
from motiondeck.page.web.private_page import PrivatePage
from motiondeck.page.web.state_line import StateLine
from motiondeck.shows.show_state import ShowState

WIDTH = 760  # pixels
GO = (43, 138, 62)

# viser keeps room for a scene, which a show has none of: the panel, docked at the right, is drawn over all of it.
SHOW_STYLE = f"""<style>
@media (min-width: 700px) {{
  #{STATE_LINE} {{ zoom: 1.7; }}
  div:has(> #{STATE_LINE}) + div {{ top: 10.9em; }}
  div[style*="right: 0px"]:has(#{STATE_LINE}), div[style*="flex-shrink: 0"]:has(#{STATE_LINE}) {{
    width: 100% !important; }}
  .mantine-Notifications-root {{ top: auto !important; bottom: 16px !important; }} }}
div:has(> #{STATE_LINE}) + div button {{ min-height: 4em; font-size: 1.4em; }}
#decks {{ display: grid; grid-template-columns: repeat(auto-fit, minmax(260px, 1fr)); gap: 8px; padding: 4px 10px;
  font-size: 12.5px; line-height: 1.4; font-variant-numeric: tabular-nums; }}
#decks > div {{ border: 2px solid; border-left-width: 8px; border-radius: 6px; padding: 5px 9px; }}
#decks b, #decks strong {{ display: block; font-size: 17px; line-height: 1.25; }}
#decks .problem {{ color: #c92a2a; font-weight: 600; }}
div:has(> #{STATE_LINE}), div:has(> #cues) {{ contain: inline-size; }}
div:has(> #cues) {{ overflow-x: auto; }}
#cues {{ border-collapse: collapse; width: calc(100% - 20px); margin: 4px 10px 10px; font-size: 13.5px; }}
#cues td {{ padding: 3px 7px; border-top: 1px solid #8884; vertical-align: top; }}
#cues td:first-child {{ font-weight: 800; text-transform: uppercase; width: 3.2em; }}
#cues .now {{ background: #2b8a3e; color: white; }}
#cues .next {{ background: #1c7ed633; }}
</style>"""


class ShowView:
    """All that is on the page of a show.

    Args:
        say: sends a word to the conductor, as if typed there; raises OSError if it is gone.
    """

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
        self._write(show_line(state))
        _put(self._decks, deck_cards(state))
        _put(self._cues, cue_table(state))

    def silent(self, seconds: float) -> None:
        """Shows that the conductor has been silent for some seconds."""
        self._write(silent_line(self._show, seconds))

    def notify(self, text: str, *, alarming: bool = False) -> None:
        """Shows a notice in every browser."""
        for client in self._page.get_clients().values():
            client.add_notification(
                "Show", text, auto_close_seconds=NOTICE_SECONDS, color="red" if alarming else "blue"
            )

    def end(self) -> None:
        """Shows that the conductor is gone; nothing can be said any more."""
        self._write(ended_show_line())
        for button in self._buttons.values():
            button.disabled = True

    def _write(self, line: StateLine) -> None:
        _put(self._line, line.as_html())


def _put(place: viser.GuiHtmlHandle, content: str) -> None:
    if place.content != content:
        place.content = content
