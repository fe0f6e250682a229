"""A fade while it runs, from before its duration is known.

Each time its search considers a longer fade, what is shown goes over to that one without a jump: the gap between both,
and its rate, run out in turn. A quintic begins so flat that after the first ticks, in which durations are found, there
is next to no gap.
"""

from __future__ import annotations

from controller.deck.joins.fade_search import SHORTEST, FadeSearch
from controller.deck.joins.transition import Fade, displaced
from controller.motion.posture import Posture


class Fading:
    """What is left of a difference, tick by tick.

    Args:
        search: finds the fade, from the next tick on.
        onset: as the property, in the beginning.
    """

    def __init__(self, search: FadeSearch, onset: float = 0.0) -> None:
        self._search = search
        self._onset = onset
        self._fade: Fade | None = None
        self._elapsed = 0.0
        self._gap: Fade | None = None
        self._gap_elapsed = 0.0
        self._turned = 0.0  # rad by which the heading has turned since the switch

    @property
    def lasts(self) -> bool:
        """Whether anything is left of the difference."""
        return self._fade is None or self._elapsed < self._fade.duration or self._gap is not None

    @property
    def found(self) -> bool:
        """Whether its duration has been found."""
        return self._search.found

    @property
    def onset(self) -> float:
        """The share of the tempo at which a one-shot is played: it gets going with the square of the progress.

        At full tempo half of it would be over before it can be seen.
        """
        progress = min(1.0, self._elapsed / self._fade.duration) if self._fade is not None else 0.0
        return self._onset + (1.0 - self._onset) * progress**2

    def advance(self, dt: float, turn_rate: float) -> None:
        """Goes dt seconds on, while the heading turns at some rad/s."""
        if self._fade is None or not self._search.found:
            self._go_over_to(self._search.advance(dt))
        self._elapsed += dt
        self._gap_elapsed += dt
        if self._gap is not None and self._gap_elapsed >= self._gap.duration:
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
        """Takes another fade of the same difference, from its present moment on."""
        before, self._fade = self._fade, fade
        if before is None or before is fade:
            return
        at, gap_at = self._elapsed, self._gap_elapsed
        value, rate = before.left(at) - fade.left(at), before.leaving(at) - fade.leaving(at)
        if self._gap is not None:
            value, rate = value + self._gap.left(gap_at), rate + self._gap.leaving(gap_at)
        self._gap, self._gap_elapsed = Fade(SHORTEST, SHORTEST, value, rate), 0.0
