"""The deck with its searches spread over ticks as the C player spreads them: what the player is compared with.

The deck compares all places where a motion can be entered in one tick, and tries a fade in each `TRIAL_EVERY` seconds.
A microcontroller has no time for that. So here, and in `player.c`, SEARCHED places are compared in a tick: one in
COARSE of all, with the body as it was when the switch was due, then those about the best of them. Meanwhile what was
played goes on; then the motion is entered as much further on. After that, SEARCHED moments of the trials of the fade
are weighed in a tick. All else is the deck's.
"""

from math import floor

import numpy as np

from controller.deck.deck import Deck
from controller.deck.joins.fade_search import FadeSearch, moments_of
from controller.deck.joins.transition import Fade
from controller.deck.performance import Performance
from controller.deck.switch import CommandedSwitch
from controller.motion.skeleton import Pose, Posture

SEARCHED, COARSE = 5, 4
CARRIED = 0.4531  # rounds to a number of anchors; the usual tempos do not come near where it rounds up


class _Search(FadeSearch):
    stalled = False
    _spare = 0

    def advance(self, dt: float) -> Fade:
        self._spare += 0 if self.stalled else SEARCHED
        return super().advance(dt)

    def _due(self) -> bool:
        moments = 1 + moments_of(self._candidate)
        due = moments <= self._spare
        self._spare -= due * moments
        return due


class _Performance(Performance):
    _searches = _Search
    entering: str | None = None

    @property
    def fading(self) -> bool:
        return self.entering is not None or super().fading

    def step(self, dt: float, tempo: float) -> bool:
        if isinstance(self._search, _Search):
            self._search.stalled = self.entering is not None
        return super().step(dt, tempo) and self.entering is None

    def switch_to(self, motion: str, phase: float | None = None) -> None:
        compared = -(-len(self.motions[motion].places) // COARSE) + 2 * (COARSE - 1)
        self.entering, self._from = motion, (self.posture, self._shown)
        self._late = self._left = (compared - 1) // SEARCHED + 1

    def jump(self, phase: float) -> None:
        if self.entering is None:
            super().jump(phase)

    def finish_tick(self) -> Pose:
        if self.entering is not None:
            self._left -= 1
            if self._left < 0:
                motion, self.entering = self.entering, None
                super().switch_to(motion)
        return super().finish_tick()

    def _best_anchor(self, motion: str, before: Posture, now: Posture) -> int:
        entering, (before, now) = self.motions[motion], self._from
        count = len(entering.places)
        coarse = COARSE * self._resembling(motion, before, now, np.arange(0, count, COARSE))
        beside = coarse + np.array([0, *(place for place in range(1 - COARSE, COARSE) if place)])
        beside = beside % count if entering.loop else beside[(beside >= 0) & (beside < count)]
        found = int(beside[self._resembling(motion, before, now, beside)])
        gone = floor(self._late * self._dt * self._tempo / entering.spacing + CARRIED) if entering.loop else 0
        return (found + gone) % count


class SpreadDeck(Deck):
    """A deck for golden traces."""

    _performs = _Performance

    def switch(self, to: str, *, direct: bool = False) -> CommandedSwitch:
        """As of `Deck`."""
        before = self.plan.current
        switch = super().switch(to, direct=direct)
        if switch is not before and isinstance(self.performance, _Performance):
            self.performance.entering = None
        return switch
