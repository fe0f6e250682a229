"""Looking back: a browser sees a moment of the last minutes, chosen on a timeline, and all others what happens now."""

import time
from bisect import bisect_left
from collections import deque
from collections.abc import Mapping
from itertools import pairwise
from operator import itemgetter
from typing import Any

import viser

from controller.motion.rotations import Array
from controller.wire.messages.replies import Event
from motiondeck.page.bodies import Bodies, View
from motiondeck.page.event_looks import LOOKS, ROUTINE
from motiondeck.page.plots import SECONDS
from motiondeck.page.web.page_state import Picture
from motiondeck.page.web.parts import Heard, OwnPart, PageParts

PICTURE_EVERY, DRAWN_EVERY = 0.1, 1.0  # s


class Timeline:
    """Keeps pictures and returns that of a past moment; the strip is the same in every browser of the page."""

    def __init__(self, parts: PageParts, heard: Heard) -> None:
        self._part = parts.add("timeline", "timeline", heard=heard)
        self._pictures: deque[tuple[float, Picture]] = deque()
        self._runs: deque[tuple[float, str]] = deque()  # when each began
        self._marks: deque[tuple[float, str, str]] = deque()
        self._now = 0.0
        self._drawn = -DRAWN_EVERY

    def keep(self, picture: Picture, shown: str, now: float) -> None:
        """Keeps a picture of a time, s, with the name of what it shows."""
        self._now = now
        if not self._runs or self._runs[-1][1] != shown:
            self._runs.append((now, shown))
        if not self._pictures or now - self._pictures[-1][0] >= PICTURE_EVERY:
            self._pictures.append((now, picture))
        while now - self._pictures[0][0] > SECONDS:
            self._pictures.popleft()
        while len(self._runs) > 1 and now - self._runs[1][0] > SECONDS:
            self._runs.popleft()
        while self._marks and now - self._marks[0][0] > SECONDS:
            self._marks.popleft()

    def mark(self, event: Event) -> None:
        """Marks an event that is worth it."""
        if (mark := LOOKS.get(event.kind, ROUTINE).mark) is not None:
            self._marks.append((self._now, mark, f"{event.kind}: {event.text}"))

    def at(self, back: float) -> tuple[float, Picture]:
        """What was shown some seconds ago, with its time, s; of what is no longer kept, the oldest."""
        place = bisect_left(self._pictures, self._now - back, key=itemgetter(0))
        return self._pictures[min(place, len(self._pictures) - 1)]

    def show(self) -> None:
        """Draws the strip, at most once in DRAWN_EVERY seconds."""
        if self._now - self._drawn < DRAWN_EVERY:
            return
        self._drawn = now = self._now
        starts = [*self._runs, (now, "")]
        runs = [
            [round(max(begins - now, -SECONDS), 1), round(ends - now, 1), name]
            for (begins, name), (ends, _) in pairwise(starts)
        ]
        marks = [[round(at - now, 1), kind, text] for at, kind, text in self._marks]
        self._part.show({"seconds": SECONDS, "runs": runs, "marks": marks})


HELD_OFF = 0.5  # s after that in which no browser looks back: a hand that drags still sends something
NOW_ALONE = ("/glow", "/steps", "/forces", "/network", "/robot target", "/shadow target")  # drawn of the present only
BODIES = [f"/{look}{whose}" for look in ("robot", "shadow") for whose in ("", " follower", " human")]


class Past:
    """The browsers that look back, each at another moment; all others see `bodies`."""

    def __init__(self, parts: PageParts, bodies: Bodies) -> None:
        self.timeline, self._bodies = Timeline(parts, self._hear), bodies
        self._frame = OwnPart(parts, "past", self._hear)
        self._asked: dict[int, tuple[float, float]] = {}  # by browser: when, and to see how far back, s
        self._moments: dict[int, tuple[float, Picture]] = {}
        self._drawn: dict[int, tuple[Bodies, View, Picture]] = {}
        self._called = -HELD_OFF

    def _hear(self, said: Any, event: viser.GuiEvent) -> None:
        match said:
            case {"back": float(back) | int(back)} if event.client_id is not None:
                self._asked[event.client_id] = time.monotonic(), back

    def look(self, client: int, moment: float) -> None:
        """Has a browser see a time, s; of what is no longer kept, the oldest."""
        self._asked[client] = (now := time.monotonic()), max(now - moment, 0.1)

    def moment(self, client: int) -> float | None:
        """The time that a browser looks back to, s; None for one that sees what happens now."""
        look = self._moments.get(client)
        return look and look[0]

    def call_back(self) -> None:
        """Has every browser see what happens now."""
        self._called = time.monotonic()
        self._moments.clear()

    def show(self, clients: Mapping[int, viser.ClientHandle], view: View, centre: Array, now: float) -> None:
        """Brings each browser to its moment, or to now, a time, s; the centre (2,), m, is that of a view that stays."""
        asked, self._asked = self._asked, {}
        for number, (at, back) in asked.items():
            if back <= 0.0:
                self._moments.pop(number, None)
            elif at - self._called > HELD_OFF:
                self._moments[number] = self.timeline.at(back)
        for number in {*self._moments, *self._drawn} - {*clients}:
            for kept in (self._moments, self._drawn):
                kept.pop(number, None)
        for number, client in clients.items():
            if (look := self._moments.get(number)) is not None:
                moment, picture = look
                self._draw(client, picture, view, picture.arrays.qpos[:2] if view.follows else centre)
                self._frame.show(client, {"back": max(round(now - moment), 1), "seconds": SECONDS})
            elif self._drawn.pop(number, None) is not None:
                _clear(client)
                self._bodies.scene.suit(client)
                self._frame.show(client, {"back": 0, "seconds": SECONDS})

    def _draw(self, client: viser.ClientHandle, picture: Picture, view: View, centre: Array) -> None:
        bodies, *before = self._drawn.get(client.client_id, (self._bodies, None, None))
        if before[0] == view and before[1] is picture:  # two pictures hold arrays, which do not compare
            return
        with client.atomic():
            if before[0] != view:
                _clear(client)
                bodies = self._bodies.twin(client)
                self._bodies.scene.suit(client)  # its floor and shadows went with the others' bodies
                for name in NOW_ALONE:
                    client.scene.add_frame(name, show_axes=False, visible=False)
            bodies.show(picture.arrays, view, centre)
        self._drawn[client.client_id] = bodies, view, picture


def _clear(client: viser.ClientHandle) -> None:
    """Removes what this browser sees in place of the others' bodies."""
    for name in (*BODIES, *NOW_ALONE, "/floor"):
        client.scene.remove_by_name(name)
