"""Beats as a reference: which phases of a loop fall on them."""

from __future__ import annotations

import math
from typing import Literal

from controller.deck.locks.beat_clock import BeatClock
from controller.deck.locks.lock import LoopPlace
from controller.deck.locks.phase_lock import Reference

STEADY_BEATS = 4
"""From so many beats on the beat is known."""

SILENT_AFTER = 4.0
"""Periods without a beat after which it counts as silent; the motion keeps its tempo."""

# The steps of a round change where the tempo would be further than this from 1, in octaves.
_RANGE = 0.75


class Beats:
    """The beats of a person or a programme, and how a loop falls on them; fits `phase_lock.ReferenceSource`.

    Args:
        phase: the phase of a loop that falls on a beat, in [0, 1].
        steps: how many beats a round has, evenly spread; 0 takes 1, 2, 4, 8 or 16, whichever tempo is nearest to 1.
    """

    name: Literal["beat"] = "beat"

    def __init__(self, phase: float = 0.0, steps: int = 0) -> None:
        self.clock = BeatClock()
        self._phase, self._steps = phase, steps
        self._chosen = 0

    @property
    def per_minute(self) -> float | None:
        """Beats a minute."""
        return 60.0 / self.clock.period if self.clock.period is not None else None

    def reference(self, playhead: LoopPlace) -> Reference | None:
        """The phase that the beat asks for; without beats it goes on with the period that it had."""
        clock = self.clock
        if clock.period is None:
            return None
        steps = self._steps or self._choose(playhead.seconds / clock.period)
        beats = (playhead.time - clock.last) / clock.period
        steady = clock.counted >= STEADY_BEATS and beats < SILENT_AFTER
        return Reference(self._phase + beats / steps, 1.0 / (steps * clock.period), 1.0 / steps, steady)

    def _choose(self, beats: float) -> int:
        """The steps for a round that takes so many beats at tempo 1."""
        if not self._chosen or abs(math.log2(beats / self._chosen)) > _RANGE:
            self._chosen = 2 ** min(max(round(math.log2(beats)), 0), 4)
        return self._chosen
