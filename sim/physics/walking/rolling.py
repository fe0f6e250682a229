"""Rolling: feet leave the floor over their toes and come down on their heels, so that legs reach farther.

A sole of half length l that is turned by a pitch theta stands on its toe edge where theta > 0, and on its heel edge
where theta < 0. Its middle is ahead of and above its place on the flat sole by

    sign(theta) l (1 - cos theta),      l |sin theta|                                                           (12)

while that edge stays where it is: the plan need not know of it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from controller.motion.rotations import Array
from sim.physics.walking.steps import Step

# The heel begins to rise so long before the foot leaves the floor, and the toes come down so long after it landed, s.
RISES, SETTLES = 0.12, 0.08
# At this share of its swing the foot is turned as it will land: toes that hang lower would scuff.
TURNED = 0.8
# So that a swinging foot does not jerk when it changes from one edge to the other: the sine it is rounded off at.
ROUNDED = 0.05


def from_flat(pitch: float, half: float) -> tuple[float, float]:
    """Equation (12): how far ahead and up the middle of a sole is, m, from its place on the flat sole."""
    up = float(np.hypot(np.sin(pitch), ROUNDED)) - ROUNDED
    return float(np.sign(pitch)) * half * (1.0 - float(np.cos(pitch))), half * up


class Rolling:
    """Turns the soles of a robot that steps.

    Attributes:
        pitches: of the soles, toes down, shape (2,), rad.
    """

    def __init__(self, toe: float, heel: float, longest: float) -> None:
        """Takes how far a foot is turned over its toes when it leaves, and over its heel when it lands, rad, after and
        before a step of the longest length, m; at shorter ones it is less in proportion, and never more than in the
        motion."""
        self.pitches, self._rates = np.zeros(2), np.zeros(2)
        self._toe, self._heel, self._longest = toe, heel, longest
        self._now, self._swings = 0.0, [False, False]
        self._left = [(0.0, 0.0), (0.0, 0.0)]
        self._landed = [(-np.inf, 0.0), (-np.inf, 0.0)]

    def advance(self, now: float, places: Array, step: Step | None, coming: Sequence[Step]) -> None:
        """Goes on to a time, s.

        Args:
            now: s.
            places: of the soles that stand, shape (2, 2), m.
            step: the one under way.
            coming: that one and those to come.
        """
        for foot in range(2):
            own = next((number for number, one in enumerate(coming) if one.foot == foot), None)
            pitch, swings = 0.0, step is not None and step.foot == foot
            if swings != self._swings[foot]:
                self._left[foot] = float(self.pitches[foot]), float(self._rates[foot])
                self._landed[foot] = now, float(self.pitches[foot])
                self._swings[foot] = swings
            if step is not None and swings:
                lands = -min(self._heel * self._stretch(step.place - places[1 - foot], step), step.lands)
                pitch = _swung(*self._left[foot], lands, now - step.start, TURNED * (step.end - step.start))
            else:
                landed, pitch = self._landed[foot]
                pitch *= 1.0 - _smooth((now - landed) / SETTLES)
                if own is not None:
                    other = coming[own - 1].place if own > 0 else places[1 - foot]
                    leaves = min(self._toe * self._stretch(other - places[foot], coming[own]), coming[own].leaves)
                    pitch += leaves * max(1.0 - (coming[own].start - now) / RISES, 0.0) ** 2
            self._rates[foot] = (pitch - self.pitches[foot]) / max(now - self._now, 1e-9)
            self.pitches[foot] = pitch
        self._now = now

    def _stretch(self, ahead: Array, step: Step) -> float:
        """How long a step is that goes so far (2,), m, compared with the longest one; 0 if it goes back."""
        along = float(ahead @ (np.cos(step.direction), np.sin(step.direction)))
        return min(max(along / self._longest, 0.0), 1.0)


def _swung(pitch: float, rate: float, lands: float, since: float, lasts: float) -> float:
    """The pitch of a foot that left the floor some seconds ago with a pitch and a rate, and lands with another."""
    u = min(since / lasts, 1.0)
    return (1.0 - u) ** 2 * ((1.0 + 2.0 * u) * pitch + u * lasts * rate) + _smooth(u) * lands


def _smooth(share: float) -> float:
    """From 0 to 1, beginning and ending softly."""
    u = min(max(share, 0.0), 1.0)
    return u * u * (3.0 - 2.0 * u)
