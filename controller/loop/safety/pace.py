"""The pace of targets in real time: after a stall, late ticks that run at once must not move the joints at once.

The safety envelope limits what happens from one of its ticks to the next; this makes sure that no more of its ticks
are written than periods have passed. Time is earned as it passes, BURST periods of it at most, and each tick that is
written spends one. In any time T therefore at most T / period + BURST + 1 - LEAST ticks are written.
"""

BURST = 2.0  # periods: a tick that comes less than a period late takes nothing from the next one
LEAST = 0.75  # of a period; so much must be earned


class Pace:
    """Decides for each tick whether its targets may be written."""

    def __init__(self, period: float) -> None:
        self._period_ns = round(period * 1e9)
        self._earned = self._period_ns
        self._last: int | None = None

    def may_write(self, now: int) -> bool:
        """Whether a tick that begins at a time (ns) may be written; if so, its period is spent."""
        passed = now - self._last if self._last is not None else 0
        self._last = now
        self._earned = min(self._earned + passed, int(BURST * self._period_ns))
        if self._earned < LEAST * self._period_ns:
            return False
        self._earned -= self._period_ns
        return True
