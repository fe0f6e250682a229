"""The timeline of the page: motions and events of the last minutes, and the pictures of them."""

from bisect import bisect_left
from collections import deque
from itertools import pairwise
from operator import itemgetter

from controller.wire.messages.replies import Event
from motiondeck.page.event_looks import LOOKS, ROUTINE
from motiondeck.page.plots import SECONDS
from motiondeck.page.web.page_state import Picture
from motiondeck.page.web.parts import Heard, PageParts

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
