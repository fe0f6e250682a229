"""The operate view: what hands need on a stage; the browser draws it, and knows by itself whether it is locked or dark.

What it says and offers is decided here, and a button has its commands as they are typed.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import astuple
from typing import Annotated, Any, NamedTuple

import msgspec
import viser

from controller.wire.messages.command_table import BY_WORD
from controller.wire.messages.deck_snapshot import DeckSnapshot
from motiondeck.page.web.parts import PageParts
from motiondeck.page.web.state_line import StateLine, shown_motions

Commands = Sequence[Sequence[str]]  # each as words


class CommandButton(NamedTuple):
    """A button, which does nothing without commands; `held` if it has to be held down."""

    label: str
    commands: Commands
    held: bool = False


class CueRow(NamedTuple):
    """A line of the cue list, and the commands that take it out."""

    mark: str  # "now", "next" or ""
    name: str
    detail: str = ""
    take_out: Commands = ()


class Operate:
    """The view on a page; `do` carries out a command, and `fixed` is what operate.js says of it."""

    def __init__(self, parts: PageParts, fixed: dict[str, Any], do: Callable[[list[str]], None]) -> None:
        self._part, self._do = parts.add("operate", "operate", fixed, self._hear), do

    def show(
        self, line: StateLine, buttons: Sequence[CommandButton], cues: Sequence[CueRow] = (), **others: Any
    ) -> str:
        """Shows a state, and returns its line for the panel; without buttons nothing can be commanded any more."""
        self._part.show({"line": astuple(line), "buttons": buttons, "cues": cues, **others})
        return line.as_html()

    def _hear(self, said: Any, _: viser.GuiEvent) -> None:
        with suppress(msgspec.ValidationError):  # whatever else a browser may say
            for words in msgspec.convert(said, list[Annotated[list[str], msgspec.Meta(min_length=1)]]):
                self._do(words)


def deck_buttons(now: DeckSnapshot) -> list[CommandButton]:
    """The buttons of a deck in a state."""
    rests = now.paused or now.mode in ("home", "held")
    following = [["queue" if place else "switch", name] for place, name in enumerate(now.queue)]
    buttons = [
        ("switch", CommandButton("Next", following)),
        ("resume", CommandButton("Resume", [["resume"]])) if rests else ("pause", CommandButton("Pause", [["pause"]])),
        ("home", CommandButton("Home", [["home"]])),
        ("reset", CommandButton("Reset", [["reset"]], held=True)),
        ("stop", CommandButton("End run", [["stop"]], held=True)),
    ]
    return [one if now.mode in BY_WORD[word].modes else one._replace(commands=()) for word, one in buttons]


def deck_cues(now: DeckSnapshot) -> list[CueRow]:
    """What a deck plays, and what it plays next."""
    begins = now.switching and now.motion != now.playing
    rows = [CueRow("now", shown_motions(now))] + [CueRow("next", now.motion)] * begins
    for place, name in enumerate(now.queue):
        # A motion that is commanded clears the queue.
        anew = [["switch", now.motion], *(["queue", one] for one in now.queue[:place] + now.queue[place + 1 :])]
        rows.append(CueRow("next" if len(rows) == 1 else "", name, take_out=() if now.switching else anew))
    return rows
