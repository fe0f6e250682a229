"""A lock to the body: a motion waits while its body is held, and goes where a hand takes it."""

from __future__ import annotations

import math
from collections.abc import Callable

from controller.deck.locks.body_lag import PoseTable
from controller.deck.locks.lock import LoopPlace, Steering
from controller.motion.rotations import Array
from controller.wire.messages.arguments import TEMPO
from controller.wire.messages.lock_state import LockStage, LockState

Measured = Callable[[], Array | None]
"""The measured joint positions, shape (J,), rad, NaN for a joint that is not measured; None before there are any."""

FREE = 0.08
"""So far behind, s of the motion at tempo 1, is how servos follow; the tempo stays as it was commanded."""

REACH = 0.12
"""Beyond that the tempo falls in proportion, by the commanded tempo (at least by 1) for so many seconds more."""

BESIDE, STOPPED = 0.15, 0.3
"""A joint that is off the motion's path by the first slows it down, one by the second stops it, rad."""

_WAITS = 0.5  # a tempo that is off by more than this share of the commanded one is that of a held body


class BodyLock:
    """Steers the tempo by how far the measured joints are behind.

    Args:
        measured: where the joints are.
    """

    rate = 5.0
    owns_tempo = False

    def __init__(self, measured: Measured) -> None:
        self._measured = measured
        self._tables: dict[str, PoseTable] = {}
        self._targets: Array | None = None  # of the last tick
        self._stage: LockStage = "searching"
        self._lag_s: float | None = None

    @property
    def state(self) -> LockState:
        """Whether the body follows, and how far it is behind the motion, ms."""
        return LockState("body", self._stage, 1e3 * self._lag_s if self._lag_s is not None else None)

    def steer(self, playhead: LoopPlace) -> Steering:
        """The commanded tempo less what a lag takes from it; it stops at FREE + REACH and goes back with a hand."""
        table, measured = self._tables.get(playhead.motion), self._measured()
        if not playhead.alone or table is None or measured is None or self._targets is None:
            self._stage, self._lag_s = "searching", None
            return Steering(playhead.tempo)
        lag, beside = table.project(playhead.phase, self._targets, measured)
        self._lag_s = lag
        size = max(1.0, abs(playhead.tempo))
        pull = math.copysign(max(0.0, abs(lag) - FREE * size) / REACH, lag)
        on_path = min(max((STOPPED - beside) / (STOPPED - BESIDE), 0.0), 1.0)
        tempo = on_path * min(max(playhead.tempo - pull, -size), 2.0 * size)
        self._stage = "waiting" if abs(tempo - playhead.tempo) > _WAITS * (abs(playhead.tempo) or 1.0) else "locked"
        return Steering(min(max(tempo, TEMPO.lowest), TEMPO.highest))

    def note(self, playhead: LoopPlace, targets: Array) -> None:
        """Takes the joint targets (J,) or more, rad, that a tick has led to; those of joins are not the motion's."""
        measured = self._measured()
        if measured is None:
            return
        own = targets[: len(measured)]
        self._targets = own.copy()
        table = self._tables.get(playhead.motion)
        if table is None:
            table = self._tables[playhead.motion] = PoseTable(playhead.seconds, len(own), loop=playhead.loop)
        if playhead.alone:
            table.note(playhead.phase, own)
        else:
            table.forget_last()
