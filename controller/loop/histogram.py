"""A histogram of durations: fixed in size, quick to add to, and exact to 2 % at any percentile.

As in an HDR histogram, every octave of nanoseconds is cut into 32 equal buckets. A bucket is then at most 1/32 of its
value wide and is reported by its middle, so that the error of a percentile is at most 1/64. Up to 64 ns it is exact.
"""

from dataclasses import dataclass, field

import msgspec
import numpy as np

from controller.motion.rotations import Indices

_HALF = 32  # buckets to an octave
_OCTAVES = 36  # the last bucket ends at 2^41 ns, 36 minutes; longer durations are counted there
_BUCKETS = _HALF * (_OCTAVES + 1)
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
    _counts: Indices = field(default_factory=lambda: np.zeros(_BUCKETS, np.int64), repr=False)
    _longest: int = 0  # ns

    def add(self, duration_ns: int) -> None:
        """Counts one duration; a negative one counts as zero."""
        self._recent.append(duration_ns)
        if len(self._recent) >= _MANY:
            self._sort_in()

    def _sort_in(self) -> None:
        durations = np.maximum(np.array(self._recent, np.int64), 0)
        self._longest = max(self._longest, int(durations.max(initial=0)))
        shift = np.maximum(np.frexp(durations)[1] - 6, 0)
        bucket = np.minimum(_HALF * shift + (durations >> shift), _BUCKETS - 1)
        self._counts += np.bincount(bucket, minlength=_BUCKETS)
        self._recent.clear()

    def percentile(self, share: float) -> float:
        """The duration, us, that this share (0 to 1) of all durations does not exceed; 0 if none was added."""
        self._sort_in()
        cumulative = np.cumsum(self._counts)
        count = int(cumulative[-1])
        if count == 0:
            return 0.0
        bucket = int(np.searchsorted(cumulative, max(share * count, 1.0)))
        shift = max(bucket // _HALF - 1, 0)
        low = (bucket - _HALF * shift) << shift
        return min(low + 0.5 * ((1 << shift) - 1), float(self._longest)) / 1000.0

    def percentiles(self) -> Percentiles:
        """The usual four, us; the maximum is exact."""
        p50, p99, p999 = (self.percentile(share) for share in (0.5, 0.99, 0.999))
        return Percentiles(p50, p99, p999, self._longest / 1000.0)
