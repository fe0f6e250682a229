"""The deck with its searches spread over ticks as the C player spreads them: what the player is compared with.

The deck compares all places where a motion can be entered in one tick, and tries a fade in each `TRIAL_EVERY` seconds.
A microcontroller has no time for that. So here, and in `player.c`, SEARCHED places are compared in a tick: one in
COARSE of all, with the body as it was when the switch was due, then those about the best of them. Meanwhile what was
played goes on; then the motion is entered as much further on, or blended in. After that, (SEARCHED + 2) / 2 moments
of the trials of the fade are weighed in a tick. Of a motion that is held as a network it is fewer: `searched`. A blend
that is given up goes over to its motion, or that of the next blend, where that is. All else is the deck's.
"""

from collections.abc import Mapping
from functools import reduce
from math import floor
from typing import Any

import numpy as np

from controller.deck.deck import Deck
from controller.deck.joins.fade_search import FadeSearch, moments_of
from controller.deck.joins.transition import Fade
from controller.deck.performance import Performance
from controller.deck.switch import CommandedSwitch
from controller.deck.switch_plan import SwitchPlan
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose, Posture

SEARCHED, COARSE = 4, 4
CLEARLY_LESS, NEXT_TO_NONE = 1.0 - 2.0**-10, 1e-4
CARRIED = 0.4531  # rounds to a number of anchors; the usual tempos do not come near where it rounds up


class _Search(FadeSearch):
    searched = _spare = 0

    def advance(self, dt: float) -> Fade:
        self._spare += self.searched
        return super().advance(dt)

    def _due(self) -> bool:
        moments = 1 + moments_of(self._candidate)
        due = moments <= self._spare
        self._spare -= due * moments
        return due


class _Performance(Performance):
    _searches = _Search
    entering: str | None = None
    _blending: Mapping[str, float] | None = None  # the weights of the blend that a motion is sought for

    @property
    def fading(self) -> bool:
        return self.entering is not None or super().fading

    def step(self, dt: float, tempo: float) -> bool:
        if isinstance(self._search, _Search):
            self._search.searched = 0 if self.entering else (self._searched(self.motion.name) + 2) // 2
        completed = super().step(dt, tempo)
        if self.blend_problem and self.entering is not None:
            self._fall_back(max(w := self.tracks.weights, key=lambda name: (name in (self._blending or ()), w[name])))
        return completed and self.entering is None

    def switch_to(self, motion: str, phase: float | None = None) -> None:
        if self.blend_problem:
            self._fall_back(motion)
        else:
            self._seek(motion, None, self.posture, self._shown)

    def blend_in(self, weights: Mapping[str, float]) -> None:
        if new := weights.keys() - self.tracks.weights.keys():
            self._seek(new.pop(), weights, self._before, self.posture)
            self._left -= 1
        else:
            super().blend_in(weights)

    def _searched(self, motion: str) -> int:
        network: Any = self.tracks.leading.player.network
        return getattr(network.keys[motion], "searched", SEARCHED)

    def _seek(self, motion: str, blend: Mapping[str, float] | None, before: Posture, now: Posture) -> None:
        compared = -(-len(self.motions[motion].places) // COARSE) + 2 * (COARSE - 1)
        self.entering, self._from, self._blending = motion, (before, now), blend
        self._late = self._left = (compared - 1) // self._searched(motion) + 1

    def _fall_back(self, motion: str) -> None:
        leaving, self.blend_problem = self.motion, ""
        track = next(track for track in self.tracks.playing if track.motion.name == motion)
        self._limit(leaving, track.motion)
        self._begin_fade(self._play_alone(track), 1.0, leaving, track.motion)

    def jump(self, phase: float) -> None:
        if self.entering is None:
            super().jump(phase)

    def finish_tick(self) -> Pose:
        if self.entering is not None:
            self._left -= 1
            if self._left < 0:
                motion, self.entering = self.entering, None
                super().switch_to(motion) if self._blending is None else super().blend_in(self._blending)
        return super().finish_tick()

    def _best_anchor(self, motion: str, before: Posture, now: Posture) -> int:
        entering, (before, now) = self.motions[motion], self._from
        count = len(entering.places)
        coarse = COARSE * _clearly_least(self._entry_costs(motion, before, now, np.arange(0, count, COARSE)))
        beside = coarse + np.array([0, *(place for place in range(1 - COARSE, COARSE) if place)])
        beside = beside % count if entering.loop else beside[(beside >= 0) & (beside < count)]
        found = int(beside[_clearly_least(self._entry_costs(motion, before, now, beside))])
        gone = floor(self._late * self._dt * self._tempo / entering.spacing + CARRIED) if entering.loop else 0
        return (found + gone) % count


def _clearly_least(costs: Array) -> int:
    """Where the least of costs is, m^2; of those that are next to alike, as where a motion rests, it is the first."""
    sums = (NEXT_TO_NONE + costs).tolist()
    return reduce(lambda best, one: one if sums[one] < CLEARLY_LESS * sums[best] else best, range(len(sums)))


class _SpreadPlan(SwitchPlan):
    _performance: Any

    def command(self, switch: CommandedSwitch, *, direct: bool) -> CommandedSwitch:
        self._performance.entering = None
        return super().command(switch, direct=direct)


class SpreadDeck(Deck):
    """A deck for golden traces."""

    _performs, _plans = _Performance, _SpreadPlan
