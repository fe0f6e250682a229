"""The page's own parts: each is drawn by a script in the browser from a little JSON, and sends back what is done.

viser carries both ways: a state is in an attribute of a hidden element, an event is the value of a hidden text field.
So parts need no connection of their own, and a page that is reloaded has the latest state at once.
"""

import html
import json
from collections.abc import Callable
from pathlib import Path
from threading import Lock, Thread
from typing import Any

import viser

from controller.wire.messages.commands import DeckCommand
from motiondeck.page.web.page_style import CURRENT, QUIET
from motiondeck.page.web.private_page import THEME, PrivatePage

Send = Callable[[DeckCommand], None]
Then = DeckCommand | Callable[[], None]
Ask = Callable[[viser.GuiEvent, str, str, str, Then], None]
"""Confirms (event, title, text, yes) in the browser that clicked; then sends or calls the last argument."""

SCRIPTS = Path(__file__).parent / "scripts"
MOST_CHARACTERS = 2000  # of an event; what is longer no part has sent
_EVENTS = "part-events"
Heard = Callable[[Any, viser.GuiEvent], None]


class Part:
    """One part on the page; `show` brings its state up to date."""

    def __init__(self, name: str, state: viser.GuiHtmlHandle) -> None:
        self._name, self._state = name, state

    def show(self, state: Any) -> None:
        """Shows a state of any JSON values; viser sends the same one only once."""
        text = html.escape(json.dumps(state, separators=(",", ":")))
        self._state.content = f'<div hidden data-state-of="{self._name}" data-state="{text}"></div>'


class OwnPart:
    """A part with another state in each browser, where the page's widgets are being added."""

    def __init__(self, parts: "PageParts", name: str, heard: Heard | None = None) -> None:
        self._name, self._of, self._lock = name, dict[int, Part](), Lock()
        parts.add(name, name, heard=heard)

        @parts.page.on_client_disconnect
        def _(client: viser.ClientHandle) -> None:
            self._of.pop(client.client_id, None)

    def show(self, client: viser.ClientHandle, state: Any) -> None:
        """Shows a state of any JSON values in one browser."""
        with self._lock:  # answers to one browser may come in two threads
            part = self._of.get(client.client_id) or Part(self._name, client.gui.add_html(""))
            self._of[client.client_id] = part
            part.show(state)


class PageParts:
    """The scripts of the parts on a page, and the way back from them."""

    def __init__(self, page: PrivatePage) -> None:
        """Puts the scripts on the page; call it where a hidden line of the panel does not matter."""
        self._gui, self.page = page.gui, page
        self._heard: dict[str, Heard] = {"views": self._view}
        scripts = [(SCRIPTS / "parts.js").read_text("utf-8")]
        scripts += [file.read_text("utf-8") for file in sorted(SCRIPTS.glob("*.js")) if file.name != "parts.js"]
        styles = "".join(file.read_text("utf-8") for file in sorted(SCRIPTS.glob("*.css")))
        # A script in HTML that is inserted does not run; a picture that cannot be loaded runs its error handler.
        start = "const s=document.createElement('script');s.textContent=this.nextElementSibling.textContent;"
        self._gui.add_html(
            f'<style>{styles}</style><div data-part="views" data-state-of="views" data-state="0" id="views"></div>'
            f'<div id="{_EVENTS}" hidden><img src="data:," onerror="{start}'
            f'document.head.append(s)"><pre>{html.escape(chr(10).join(scripts), quote=False)}</pre></div>'
        )
        self._events = self._gui.add_text("events of own parts", "")
        self._events.on_update(self._hear)

    def add(self, kind: str, name: str, fixed: dict[str, Any] | None = None, heard: Heard | None = None) -> Part:
        """Adds a part that a script of this kind draws, where the page's widgets are being added; the name is unique.

        What does not change is `fixed`, any JSON values, in the element's `data-fixed`. What it sends, and viser's
        event, which knows the browser, are passed to `heard`, in a new thread.
        """
        about = html.escape(json.dumps(fixed or {}, separators=(",", ":")))
        self._gui.add_html(f'<div id="{name}" class="part" data-part="{kind}" data-fixed="{about}"></div>')
        if heard is not None:
            self._heard[name] = heard
        return Part(name, self._gui.add_html(""))

    def gui_of(self, event: viser.GuiEvent) -> viser.GuiApi:
        """The widgets of the browser of an event."""
        return event.client.gui if event.client is not None else self.page.gui

    def ask(
        self, event: viser.GuiEvent, title: str, text: str, yes: str, then: Callable[[], None], no: str = "Cancel"
    ) -> None:
        """Asks for confirmation in the browser that clicked; `yes` calls the function."""
        gui = self.gui_of(event)
        with gui.add_modal(title) as question:
            gui.add_markdown(text)
            agree = gui.add_button(yes, color=CURRENT)
            gui.add_button(no, color=QUIET).on_click(lambda _: question.close())

        @agree.on_click
        def _(_: viser.GuiEvent) -> None:
            question.close()
            then()

    def _view(self, said: Any, event: viser.GuiEvent) -> None:
        """Suits widgets and scene to a browser that is dark or light, and has a panel over its scene or not."""
        match said:
            case {"dark": bool(dark), "whole": bool(whole)} if event.client is not None:
                event.client.gui.configure_theme(**THEME, dark_mode=dark)
                self.page.suit(event.client, (dark, whole))

    # The field is all browsers' own: only a coroutine finds in it what the browser of its event has sent.
    async def _hear(self, event: viser.GuiEvent) -> None:
        # What this program sets reports no client.
        text = str(self._events.value)
        if event.client is None or len(text) > MOST_CHARACTERS:
            return
        try:
            name, value, _ = json.loads(text)
            heard = self._heard.get(name)
        except (ValueError, TypeError):
            return  # not from a part of ours
        if heard is not None:
            Thread(target=heard, args=(value, event), daemon=True).start()
