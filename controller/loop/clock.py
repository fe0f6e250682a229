"""The clock of ticks with absolute deadlines: that of tick k is k periods after the start, so the rate cannot drift."""

# ruff: noqa: D102 (`Ticker` documents what the methods of a `Clock` do)

import time
from dataclasses import dataclass, field
from typing import Literal, Protocol

from motiondeck_base.errors import MotiondeckError

# While ticks are moved onto another clock, a period is longer or shorter by at most so much of it. Shorter ones make
# joints faster than their limits say by as much, so that is hardly more than clocks drift anyway.
LATER, EARLIER = 0.01, 0.0005
_SOONER = 0.1  # of a period by which ticks are at most moved forward; else they are moved back to the next one
SPIN_NS = 200_000  # before a deadline spent reading the clock, because a sleep wakes up late by about as much


class RateError(MotiondeckError):
    """A rate at which no loop can run."""


class Clock(Protocol):
    """A clock, as the loop uses it; see `Ticker`."""

    overruns: int
    skipped: int

    @property
    def period(self) -> float: ...
    def now(self) -> int: ...
    def start(self) -> None: ...
    def wait(self) -> int: ...


def period_ns(rate: float) -> int:
    """The time between two ticks at a rate in Hz, ns; raises a RateError if no loop runs at this rate."""
    if not 1.0 <= rate <= 10_000.0:
        raise RateError(f"a loop cannot run at {rate} Hz; give a rate from 1 to 10000")
    return round(1e9 / rate)


@dataclass
class Ticker:
    """Ticks on the monotonic clock: sleeps until shortly before the deadline, then spins. RateError if out of range."""

    rate: float
    # What an overrun does: `skip` drops the missed ticks, `catch_up` runs them without waiting.
    policy: Literal["skip", "catch_up"] = "skip"
    overruns: int = field(default=0, init=False)  # ticks that began more than a period late
    skipped: int = field(default=0, init=False)  # ticks that never ran

    def __post_init__(self) -> None:
        self._period = period_ns(self.rate)
        self._deadline = self.now()
        self._shift = 0

    @property
    def period(self) -> float:
        """Seconds from tick to tick."""
        return self._period * 1e-9

    def now(self) -> int:
        """The monotonic clock, ns."""
        return time.monotonic_ns()

    def due(self) -> float:
        """When the present tick was due by that clock, s; of several that were missed, the last one."""
        return 1e-9 * self._deadline

    def start(self) -> None:
        """Makes the present the time of tick 0 and clears the counts."""
        self._deadline = self.now()
        self.overruns = self.skipped = self._shift = 0

    def align(self, here: int, there: int) -> None:
        """Moves the ticks slowly onto the multiples of their period on a clock that shows `there` at `here`, ns."""
        after = (self._deadline - here + there) % self._period
        self._shift = -after if after < _SOONER * self._period else self._period - after

    def wait(self) -> int:
        """Waits for the next deadline; returns how long after it the wait ended, ns."""
        shift = min(max(self._shift, -round(EARLIER * self._period)), round(LATER * self._period))
        self._shift -= shift
        self._deadline += self._period + shift
        spare = self._deadline - self.now() - SPIN_NS
        if spare > 0:
            time.sleep(spare * 1e-9)
        now, deadline = time.monotonic_ns, self._deadline
        while (late := now() - deadline) < 0:
            pass
        if late > self._period:
            self.overruns += 1
            if self.policy == "skip":
                missed = late // self._period
                self.skipped += missed
                self._deadline += missed * self._period
        return late
