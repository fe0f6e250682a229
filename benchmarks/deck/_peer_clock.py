"""The clock of loop-rate-limiters, as our loop can run on it."""

from __future__ import annotations

import importlib
import time
from types import ModuleType


def _installed() -> ModuleType | None:
    try:
        return importlib.import_module("loop_rate_limiters")
    except ImportError:
        return None


limiters = _installed()


class PeerClock:
    """The clock of loop-rate-limiters; fits `controller.loop.clock.Clock`."""

    def __init__(self, rate: float) -> None:
        assert limiters is not None
        self._rate = rate
        self.overruns = self.skipped = 0
        self.start()

    @property
    def period(self) -> float:
        """Seconds from tick to tick."""
        return 1.0 / self._rate

    def now(self) -> int:
        """The clock that the peer uses, ns."""
        return time.perf_counter_ns()

    def start(self) -> None:
        """Makes the present the time of tick 0."""
        assert limiters is not None
        self._limiter = limiters.RateLimiter(self._rate, warn=False)
        self.overruns = 0

    def wait(self) -> int:
        """Waits for the next tick; returns how late it is by the peer's own promise, ns."""
        due = self._limiter.next_tick
        self._limiter.sleep()
        late = time.perf_counter() - due
        self.overruns += late > self.period
        return int(1e9 * late)
