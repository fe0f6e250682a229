"""Rolling: feet leave the floor over their toes and land on their heels, so that legs reach farther.

A sole of half length l that is turned by a pitch theta stands on its toe edge where theta > 0, and on its heel edge
where theta < 0. Its middle is ahead of and above its place on the flat sole by

    sign(theta) l (1 - cos theta),      l |sin theta|                                                           (12)

while that edge stays where it is: the plan need not know of it.
"""

from collections.abc import Sequence

import numpy as np

from controller.motion.rotations import Array
from sim.physics.walking.steps import Step

# Rise of the heel before the foot leaves the floor, and settling of the toes after it landed, s.
RISES, SETTLES = 0.12, 0.08
TURNED = 0.8  # share of a swing after which the foot has its landing pitch: hanging toes would scuff
ROUNDED = 0.05  # sine at which (12) is rounded off, against a jerk from edge to edge


def from_flat(pitch: float, half: float) -> tuple[float, float]:
    """Equation (12): displacement of the middle of a sole ahead and up, m."""
    up = float(np.hypot(np.sin(pitch), ROUNDED)) - ROUNDED
    return float(np.sign(pitch)) * half * (1.0 - float(np.cos(pitch))), half * up


class Rolling:
    """Pitches of the soles, toes down, shape (2,), rad, in `pitches`."""

    def __init__(self, toe: float, heel: float, longest: float) -> None:
        """Args: pitch over the toes at leaving and over the heel at landing, rad, for a step of the longest length, m.

        Shorter steps have less in proportion, and never more than the motion's.
        """
        self.pitches, self._rates = np.zeros(2), np.zeros(2)
        self._toe, self._heel, self._longest = toe, heel, longest
        self._now, self._swings = 0.0, [False, False]
        self._left = [(0.0, 0.0), (0.0, 0.0)]
        self._landed = [(-np.inf, 0.0), (-np.inf, 0.0)]

    def advance(self, now: float, places: Array, step: Step | None, coming: Sequence[Step]) -> None:
        """Advances to a time, s, with the standing soles (2, 2), m, the present step, and it with those to come."""
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
        """Length of a step by a vector (2,), m, relative to the longest one; 0 if it goes back."""
        along = float(ahead @ (np.cos(step.direction), np.sin(step.direction)))
        return min(max(along / self._longest, 0.0), 1.0)


def _swung(pitch: float, rate: float, lands: float, since: float, lasts: float) -> float:
    """The pitch of a foot, `since` seconds after leaving with a pitch and a rate, until it lands with another."""
    u = min(since / lasts, 1.0)
    return (1.0 - u) ** 2 * ((1.0 + 2.0 * u) * pitch + u * lasts * rate) + _smooth(u) * lands


def _smooth(share: float) -> float:
    u = min(max(share, 0.0), 1.0)
    return u * u * (3.0 - 2.0 * u)
