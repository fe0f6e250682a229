"""A histogram of durations: fixed in size, quick to add to, and exact to 2 % at any percentile.

Buckets begin at whole nanoseconds that rise by 2.4 % each and are reported by their middles; exact up to 42 ns.
"""

from dataclasses import dataclass, field

import msgspec
import numpy as np

from controller.motion.rotations import Indices

_BEGINS = np.unique(np.geomspace(1.0, 2.0**41, 1200).astype(np.int64))  # of the buckets, ns; the last one never ends
_LOWEST = np.append(0, _BEGINS)
_MIDDLES = 0.5 * (_LOWEST + np.maximum(np.append(_BEGINS, 0) - 1, _LOWEST))  # ns
_MANY = 256  # durations are sorted into buckets together, as one by one takes ten times as long in a tick


class Percentiles(msgspec.Struct, frozen=True):
    """Percentiles of durations, us."""

    p50: float
    p99: float
    p999: float
    max: float


@dataclass
class DurationHistogram:
    """Counts durations; what it keeps does not grow."""

    _recent: list[int] = field(default_factory=list[int], repr=False)  # still to be sorted in, ns
    _counts: Indices = field(default_factory=lambda: np.zeros(len(_BEGINS) + 1, np.int64), repr=False)
    _longest: int = 0  # ns

    def add(self, duration_ns: int) -> None:
        """Counts one duration; a negative one counts as zero."""
        self._recent.append(duration_ns)
        if len(self._recent) >= _MANY:
            self._sort_in()

    def _sort_in(self) -> None:
        durations = np.array(self._recent, np.int64)
        self._longest = max(self._longest, int(durations.max(initial=0)))
        self._counts += np.bincount(np.searchsorted(_BEGINS, durations, "right"), minlength=len(self._counts))
        self._recent.clear()

    def percentile(self, share: float) -> float:
        """The duration, us, that this share (0 to 1) of all durations does not exceed; 0 if none was added."""
        self._sort_in()
        cumulative = np.cumsum(self._counts)
        bucket = np.searchsorted(cumulative, max(share * float(cumulative[-1]), 1.0))
        return min(float(_MIDDLES.take(bucket, mode="clip")), self._longest) / 1000.0

    def percentiles(self) -> Percentiles:
        """The usual four, us; the maximum is exact."""
        p50, p99, p999 = (self.percentile(share) for share in (0.5, 0.99, 0.999))
        return Percentiles(p50, p99, p999, self._longest / 1000.0)
