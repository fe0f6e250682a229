"""A histogram of durations: fixed in size, quick to add to, and exact to 2 % at any percentile.

As in an HDR histogram, every octave of nanoseconds is cut into 32 equal buckets. A bucket is then at most 1/32 of its
value wide and is reported by its middle, so that the error of a percentile is at most 1/64. Up to 64 ns it is exact.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field

import msgspec
import numpy as np

_HALF = 32  # buckets to an octave
_OCTAVES = 36  # the last bucket ends at 2^41 ns, 36 minutes; longer durations are counted there
_BUCKETS = _HALF * (_OCTAVES + 1)


class Percentiles(msgspec.Struct, frozen=True):
    """Percentiles of durations, us."""

    p50: float
    p99: float
    p999: float
    max: float


@dataclass
class DurationHistogram:
    """Counts durations; adding one allocates nothing that stays."""

    longest: int = 0  # the longest duration so far, ns, exact
    count: int = 0
    _counts: array[int] = field(default_factory=lambda: array("Q", bytes(8 * _BUCKETS)), repr=False)

    def add(self, duration_ns: int) -> None:
        """Counts one duration; a negative one counts as zero."""
        duration_ns = max(duration_ns, 0)
        shift = max(duration_ns.bit_length() - 6, 0)
        self._counts[min(_HALF * shift + (duration_ns >> shift), _BUCKETS - 1)] += 1
        self.count += 1
        self.longest = max(self.longest, duration_ns)

    def percentile(self, share: float) -> float:
        """The duration, us, that this share (0 to 1) of all durations does not exceed; 0 if none was added."""
        if self.count == 0:
            return 0.0
        cumulative = np.cumsum(np.frombuffer(self._counts, dtype=np.uint64))
        bucket = int(np.searchsorted(cumulative, max(share * self.count, 1.0)))
        shift = max(bucket // _HALF - 1, 0)
        low = (bucket - _HALF * shift) << shift
        return min(low + 0.5 * ((1 << shift) - 1), float(self.longest)) / 1000.0

    def percentiles(self) -> Percentiles:
        """The usual four, us; the maximum is exact."""
        p50, p99, p999 = (self.percentile(share) for share in (0.5, 0.99, 0.999))
        return Percentiles(p50, p99, p999, self.longest / 1000.0)
