"""The notices of a page, in one line: alarms stay until somebody acknowledges them, and others pass."""

import re
import time
from typing import Any, NamedTuple

import viser

from motiondeck.page.web.parts import PageParts

NOTICE_SECONDS = 8.0
BEFORE_NAMES = " Servos: "  # in an event with one cause


class ActiveAlarm(NamedTuple):
    """A cause that has not been acknowledged: the servos that it was last about, and how often it came."""

    title: str
    cause: str
    servos: str
    times: int

    @property
    def key(self) -> str:
        """What it is about, without what follows from it or is to be done, and of however many servos."""
        return self.title + re.sub(r"\b\d+ (of \d+ )?servos", "servos", re.split("[.;] ", self.cause)[0])


class Notices:
    """The line of notices, the same in every browser."""

    def __init__(self, parts: PageParts) -> None:
        self._part = parts.add("notices", "notices", heard=self._hear)
        self._alarms: list[ActiveAlarm] = []
        self._passing, self._since = ("", ""), 0.0

    def add(self, title: str, text: str, *, alarming: bool = False) -> None:
        """Shows a notice; an alarm comes first, and one about the same is counted."""
        if alarming:
            cause, _, servos = text.partition(BEFORE_NAMES)
            new = ActiveAlarm(title, cause, servos, 1)
            times = 1 + sum(one.times for one in self._alarms if one.key == new.key)
            self._alarms = [new._replace(times=times), *(one for one in self._alarms if one.key != new.key)]
        else:
            self._passing, self._since = (title, text), time.monotonic()
        self.show()

    def show(self) -> None:
        """Brings the line up to date."""
        passing = self._passing if time.monotonic() - self._since < NOTICE_SECONDS else None
        self._part.show({"alarms": self._alarms[:1], "more": len(self._alarms) - 1, "passing": passing})

    def _hear(self, said: Any, event: viser.GuiEvent) -> None:
        match said:
            case {"acknowledge": [str(title), str(cause), *_]}:
                self._alarms = [one for one in self._alarms if (one.title, one.cause) != (title, cause)]
                self.show()
