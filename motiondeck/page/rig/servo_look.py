"""The status of a servo on the page: a level (ok, warn, bad, off) and words."""

from dataclasses import dataclass

import numpy as np

from hardware.rig.supervision.servo_states import ServoStates
from motiondeck.page.web.page_state import RigDescription

LATE, LATE_FOR = 0.15, 0.5  # rad that a joint may be behind its goal, and for how long, s, before it counts as late

_LEVELS = {
    "well": "ok",
    "was cut off": "warn",
    "has a low supply voltage": "warn",
    "is getting hot": "warn",
    "gives way": "warn",
    "does not follow": "warn",
    "is off on command": "off",
}
COLOURS = {"ok": (43, 138, 62), "warn": (247, 103, 7), "bad": (224, 49, 49), "off": (134, 142, 150)}


@dataclass(frozen=True)
class ServoLook:
    """The status of one servo."""

    level: str  # ok, warn, bad or off
    words: str


class ServoLooks:
    """Judges the servos of a rig."""

    def __init__(self, rig: RigDescription) -> None:
        self._words = rig.conditions
        self._on_time = np.full(len(rig.servos), -np.inf)  # when each was last near its goal, s

    def of(self, servos: ServoStates, now: float) -> list[ServoLook]:
        """The look of each servo at a time, s; none before the first answer of the rig."""
        conditions = servos.conditions
        if not np.isfinite(conditions).all():
            return []
        near = np.abs(servos.goals - servos.positions) < LATE
        self._on_time[near | np.isinf(self._on_time)] = now
        late = now - self._on_time > LATE_FOR
        return [self._look(int(place), bool(lags)) for place, lags in zip(conditions, late, strict=True)]

    def _look(self, place: int, late: bool) -> ServoLook:
        words = self._words[place]
        if place == 0:
            return ServoLook("warn", "is late") if late else ServoLook("ok", "ok")
        return ServoLook(_LEVELS.get(words, "bad"), words)
