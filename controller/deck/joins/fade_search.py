"""Fades: the search for the duration of a fade, the shortest that keeps joints in bounds, and the fade while it runs.

A trial computes speed and acceleration of the joints under a fade over the target's next course. From SHORTEST on the
fade is made longer until it is in bounds. If none up to LONGEST is, or two in turn are worse than the one before, its
rate runs out in half of the time, and then in a quarter; a body that is too fast when the search begins is slowed down
in a quarter first. With each trial the best fade so far may exceed the bounds by more: until one is found, the body
swings on.

A trial takes about as long as a tick has to spare, and three are usual. So they run while the fade begins (`Fading`):
the difference is found in the first tick, and then there is one trial in TRIAL_EVERY seconds. The ticks in which trials
run depend on the length of ticks alone.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from controller.deck.joins.deck_motions import SUMMED
from controller.deck.joins.join_limits import Bounds
from controller.deck.joins.transition import Fade, displaced
from controller.motion.rotations import Array, cross, dot
from controller.motion.skeleton import Posture

SHORTEST, LONGEST = 0.2, 1.6
PLANNED_SHARE = 0.8  # the part of the bounds that a fade may use: it is looked at at some moments only
TRIAL_EVERY = 0.005  # the time between trials, s
# What a body was doing is slowed down as long as the difference fades, or within these shares of that time, which lets
# it swing less far but accelerates it more.
_SLOWED_WITHIN = (1.0, 0.5, 0.25)
# After how many trials a fade may exceed the bounds, and by what share of them more with each trial.
_PATIENT_TRIALS, _YIELDING = 6, 0.02
_ALL_BUT = 1.001  # of the bounds: a second trial often uses exactly all of them, but for rounding
# At how many moments until its rate has run out a fade's speed and acceleration are computed, and by which factor it is
# lengthened at least.
_SAMPLES = 16
_LONGER = 1.1


class FadeSearch:
    """Finds the fade of a difference, trial by trial, in which no joint exceeds the bounds.

    `differ`, called with the first step, finds the difference, as `transition.difference`; `ahead` is the target's
    course at times (S,) from now on, s, the first 0; `chain` says which bones lead to each joint, shape (B, B), as of a
    skeleton. The bound of the acceleration is that beyond the target's own.
    """

    def __init__(
        self, differ: Callable[[], tuple[Array, Array]], ahead: Callable[[Array], Array], chain: Array, bounds: Bounds
    ) -> None:
        # The one that was found; until then the best, or, while the longer is the better, the next one to try; None
        # before the first step.
        self.fade: Fade | None = None
        self.found = False
        self.trials = 0
        self._differ, self._ahead, self._chain, self._bounds = differ, ahead, chain, bounds
        self._shares = list(_SLOWED_WITHIN)
        self._least, self._already = np.inf, 0.0
        self._last, self._rises = np.inf, 0  # the use by the trial before, and how often in turn it has risen
        self._elapsed = 0.0

    def advance(self, dt: float) -> Fade:
        """Goes on by what falls into the next dt seconds, unless it has been found; the fade to go on with."""
        if self.fade is None:
            self.fade = self._candidate = self._best = Fade(SHORTEST, SHORTEST, *self._differ())
        self._elapsed += dt
        while not self.found and self._due():
            self.fade = self._try()
        return self.fade

    def _due(self) -> bool:
        return (self.trials + 1) * TRIAL_EVERY < self._elapsed - 1e-9

    def _try(self) -> Fade:
        fade, self.trials = self._candidate, self.trials + 1
        beyond = self._beyond(fade)
        if self.trials == 1 and self._already > PLANNED_SHARE * self._bounds.speed:
            self._shares.reverse()
        if better := beyond < self._least:
            self._best, self._least = fade, beyond
        self._rises = self._rises + 1 if beyond > _ALL_BUT * self._last else 0
        self._last = beyond
        if exhausted := fade.duration >= LONGEST or self._rises == 2:
            self._shares.pop(0)
            duration, self._last, self._rises = self._best.duration, np.inf, 0
        else:
            duration = min(LONGEST, fade.duration * max(_LONGER, float(np.sqrt(beyond))))
        allowed = _ALL_BUT + _YIELDING * max(0, self.trials - _PATIENT_TRIALS)
        self.found = self._least <= allowed or not self._shares
        if self.found:
            return self._best
        self._candidate = replace(fade, duration=duration, slowing=self._shares[0] * duration)
        return self._candidate if better and not exhausted and fade.slowing == fade.duration else self._best

    def _beyond(self, fade: Fade) -> float:
        """The use of the planned share of the bounds by a fade; 1 is the limit."""
        speeds, acceleration = peaks(fade, self._ahead, self._chain)
        # A body that is already faster than that is slowed down by no choice of the duration.
        self._already = self._already or float(speeds[0])
        fastest = max(PLANNED_SHARE * self._bounds.speed, self._already)
        # What a difference in place costs goes with 1 / T in speed and 1 / T^2 in acceleration, one in speed goes
        # with 1 and 1 / T: the former never overshoots. But what moves fast away from the target goes the farther
        # the longer it is given.
        return max(acceleration / (PLANNED_SHARE * self._bounds.acceleration), (float(speeds.max()) / fastest) ** 2)


def moments_of(fade: Fade) -> int:
    """The number of parts of a fade after which its speed and acceleration are computed."""
    return round(_SAMPLES * fade.duration / fade.slowing)


def peaks(fade: Fade, ahead: Callable[[Array], Array], chain: Array) -> tuple[Array, float]:
    """How fast joints are during a fade, and how much they are accelerated beyond its target's own motion.

    Returns the speed of the fastest joint in each part of the fade, shape (parts,), m/s, and the largest acceleration
    beyond the target's own, m/s^2; `ahead` and `chain` are as for `FadeSearch`.
    """
    samples = moments_of(fade)
    step = fade.duration / samples
    time: Array = step * np.arange(samples + 1.0)
    shares = np.stack(fade.shares(time), axis=-1)
    left = (shares @ np.stack([fade.value, fade.rate]).reshape(2, -1)).reshape(len(time), -1, 3)
    target = ahead(time)
    turn_rate = target[:, -1]
    heading = step * (np.cumsum(turn_rate) - 0.5 * (turn_rate + turn_rate[0]))
    cosine, sine = np.cos(heading), np.sin(heading)
    facing = np.array([[cosine, sine], [-sine, cosine]]).transpose(2, 0, 1)
    bones = target[:, :-4].reshape(len(time), -1, 3).copy()
    bones[..., :2] = bones[..., :2] @ facing
    parts = 1 + len(chain)
    away = _turned_away(bones, left[:, 1:parts])
    drift = left[:, parts]
    root = np.empty((len(time), 3))  # its velocity along the ground and its height
    root[:, :2] = (target[:, None, -3:-1] @ facing)[:, 0] + drift[:, 1:]
    root[:, 2] = target[:, -4] + drift[:, 0]
    walked = np.empty((samples, 1, 3))
    walked[:, 0, :2] = 0.5 * (root[1:, :2] + root[:-1, :2])
    walked[:, 0, 2] = (root[1:, 2] - root[:-1, 2]) / step
    places, beside = np.zeros((2, len(time), parts, 3))  # the root stays where it is
    np.matmul(chain, away, out=beside[:, 1:])
    np.matmul(chain, bones, out=places[:, 1:])
    places += beside
    moved = (places[1:] - places[:-1]) / step + walked
    beyond = (beside[2:] - 2.0 * beside[1:-1] + beside[:-2]) / step**2
    beyond[..., :2] += ((drift[2:, 1:] - drift[:-2, 1:]) / (2.0 * step))[:, None]
    beyond[..., 2] += ((drift[2:, 0] - 2.0 * drift[1:-1, 0] + drift[:-2, 0]) / step**2)[:, None]
    return np.sqrt(dot(moved, moved).max(-1)), float(np.sqrt(dot(beyond, beyond).max()))


def _turned_away(vectors: Array, turns: Array) -> Array:
    """By how much rotation vectors (..., 3) change vectors (..., 3) that they turn (Rodrigues)."""
    half = np.maximum(0.5 * np.sqrt(dot(turns, turns)), 1e-12)
    sine = np.sin(half) / half
    first = cross(turns, vectors)
    return (sine * np.cos(half))[..., None] * first + (0.5 * sine * sine)[..., None] * cross(turns, first)


class Fading:
    """A fade while it runs, from before its duration is known: what is left of a difference, tick by tick.

    Each time its search considers a longer fade, what is shown goes over to that one without a jump: the gap between
    both, and its rate, run out in turn. A quintic begins so flat that after the first ticks, in which durations are
    found, there is next to no gap.
    """

    def __init__(self, search: FadeSearch, onset: float = 0.0) -> None:
        self._search, self._onset = search, onset
        self._fade: Fade | None = None
        self._elapsed = 0.0
        self._gap: Fade | None = None
        self._gap_elapsed = 0.0
        self._turned = 0.0  # rad by which the heading has turned since the switch

    @property
    def lasts(self) -> bool:
        """Whether anything is left of the difference."""
        return self._fade is None or self._elapsed < self._fade.duration - SUMMED or self._gap is not None

    @property
    def found(self) -> bool:
        """Whether its duration has been found."""
        return self._search.found

    @property
    def onset(self) -> float:
        """The share of the tempo at which a one-shot is played: it gets going with the square of the progress."""
        # At full tempo half of it would be over before it can be seen.
        progress = min(1.0, self._elapsed / self._fade.duration) if self._fade is not None else 0.0
        return self._onset + (1.0 - self._onset) * progress**2

    def advance(self, dt: float, turn_rate: float) -> None:
        """Goes dt seconds on, while the heading turns at some rad/s."""
        if self._fade is None or not self._search.found:
            self._go_over_to(self._search.advance(dt))
        self._elapsed += dt
        self._gap_elapsed += dt
        if self._gap is not None and self._gap_elapsed >= SHORTEST - SUMMED:
            self._gap = None
        self._turned += turn_rate * dt

    def shown(self, target: Posture) -> Posture:
        """The target with what is left of the difference, from the first `advance` on."""
        assert self._fade is not None
        left = self._fade.left(self._elapsed)
        if self._gap is not None:
            left += self._gap.left(self._gap_elapsed)
        return displaced(target, left, self._turned)

    def _go_over_to(self, fade: Fade) -> None:
        before, self._fade = self._fade, fade
        if before is None or before is fade:
            return
        at, gap_at = self._elapsed, self._gap_elapsed
        value, rate = before.left(at) - fade.left(at), before.leaving(at) - fade.leaving(at)
        if self._gap is not None:
            value, rate = value + self._gap.left(gap_at), rate + self._gap.leaving(gap_at)
        self._gap, self._gap_elapsed = Fade(SHORTEST, SHORTEST, value, rate), 0.0
