"""The log of a run on its page: what has happened, in the browsers that look at it, and there one finds it by words."""

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import viser

from controller.wire.messages.replies import Event
from motiondeck.page.event_looks import LOOKS, ROUTINE
from motiondeck.page.web.parts import OwnPart, PageParts

KEPT = 1000  # events


class EventLog:
    """One part of the page, where its widgets are being added; `look` has a browser see a time, s."""

    def __init__(self, parts: PageParts, look: Callable[[int, float], None]) -> None:
        self._look = look
        parts.add("log", "log", heard=self._hear).show({})
        self._entries = OwnPart(parts, "log-entries")
        self._kept: deque[tuple[float, float, str, str, str, bool]] = deque(maxlen=KEPT)
        self._looking: dict[int, int] = {}  # how many events each browser that looks was shown
        self._count = 0

    def note(self, event: Event, now: float, run_s: float) -> None:
        """Takes an event of a time, s, and of the run's, s."""
        look = LOOKS.get(event.kind, ROUTINE)
        self._kept.appendleft((round(run_s, 2), now, event.kind, look.title, event.text, look.alarming))
        self._count += 1

    def show(self, clients: Mapping[int, viser.ClientHandle]) -> None:
        """Brings the browsers that look at it up to date."""
        for number, shown in [*self._looking.items()]:
            if number in clients and shown != self._count:
                self._looking[number] = self._count
                self._entries.show(clients[number], [*self._kept])

    def _hear(self, said: Any, event: viser.GuiEvent) -> None:
        match said:
            case {"looking": bool(looking)} if event.client_id is not None:
                self._looking.pop(event.client_id, None)
                if looking:
                    self._looking[event.client_id] = -1
            case {"moment": float(moment) | int(moment)} if event.client_id is not None:
                self._look(event.client_id, moment)
