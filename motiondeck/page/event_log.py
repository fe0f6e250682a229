"""The log of a run on its page: what has happened, for the browsers that ask for it, where one finds it by words."""

from collections import deque
from collections.abc import Callable
from typing import Any

import viser

from controller.wire.messages.replies import Event
from motiondeck.page.event_looks import LOOKS, ROUTINE
from motiondeck.page.web.parts import OwnPart, PageParts

KEPT = 1000  # events


class EventLog:
    """One part of the page, where its widgets are being added; `look` has a browser see a time, s."""

    def __init__(self, parts: PageParts, look: Callable[[int, float], None]) -> None:
        self._look, self._count = look, 0
        parts.add("log", "log", heard=self._hear).show({})
        self._entries = OwnPart(parts, "log-entries")
        self._kept: deque[tuple[float, float, str, str, str, bool]] = deque(maxlen=KEPT)

    def note(self, event: Event, now: float, run_s: float) -> None:
        """Takes an event of a time, s, and of the run's, s."""
        look = LOOKS.get(event.kind, ROUTINE)
        self._kept.appendleft((round(run_s, 2), now, event.kind, look.title, event.text, look.alarming))
        self._count += 1

    def _hear(self, said: Any, event: viser.GuiEvent) -> None:
        match said:
            case {"known": int(known)} if event.client is not None and known != self._count:
                self._entries.show(event.client, {"count": self._count, "entries": [*self._kept]})
            case {"moment": float(moment) | int(moment)} if event.client is not None:
                self._look(event.client.client_id, moment)
