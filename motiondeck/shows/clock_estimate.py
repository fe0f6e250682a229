"""The show clock on a deck's machine: offset and drift of a remote clock, estimated from round trips.

A question sent at s and answered at r (local times) with the remote time t measures the offset of the remote clock at
the middle of the round trip,

    o = t - (s + r) / 2,    |error| <= (r - s) / 2,

and the shorter the round trip, the less it waited in queues (the minimum filter of NTP: Mills, "Computer Network Time
Synchronization", 2nd ed., section 3.7). Offset a and drift b are those of a line o = a + b (m - m0) through the latest
samples of the middles m, by weighted least squares with a prior on the drift:

    minimise  sum_i (o_i - a - b (m_i - m0))^2 / sigma_i^2 + (b / sigma_b)^2

    sigma_i^2 = s0^2 (1 + (q_i / s0)^2)^(3/2) + (w (m0 - m_i))^2,    q_i = (d_i - d_min) / 2,    d_i = r_i - s_i.

Of a sample that has waited, q bounds the error, and most such errors have one sign; so it counts by less than 1 / q^2.
On busy machines few samples have waited nowhere: they are kept for minutes, and count less as they age, because the
drift wanders. The uncertainty is d_min / 2, because no exchange of messages shows by how much the fastest way there and
the fastest way back differ, plus twice the standard deviation of the line.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

WINDOW = 120.0  # samples older than this are forgotten, s
MOST_SAMPLES = 1024
DRIFT = 200e-6  # standard deviation of the drift between two machines before it is measured
JITTER = 4e-4  # standard deviation of a sample that waited nowhere, s
WANDER = 1e-6  # how much the drift wanders meanwhile, w
_SLACK = 2e-3  # s by which a sample may contradict the line before it counts as one of another clock
_CONTRADICTIONS = 3  # such samples in a row begin the estimate anew


@dataclass(frozen=True, slots=True)
class RoundTrip:
    """One question and its answer."""

    sent: float  # local time, s
    remote: float  # the remote time in the answer, s
    received: float  # local time, s

    @property
    def seconds(self) -> float:
        """How long it took."""
        return self.received - self.sent

    @property
    def middle(self) -> float:
        """The local time half-way, s."""
        return 0.5 * (self.sent + self.received)

    @property
    def offset(self) -> float:
        """By how much the remote clock was ahead, if both ways took equally long, s."""
        return self.remote - self.middle


class ClockEstimate:
    """Estimates a remote clock; all local times are those of one steady clock, s."""

    def __init__(self) -> None:
        self._trips: deque[RoundTrip] = deque(maxlen=MOST_SAMPLES)
        self._contradicting: list[RoundTrip] = []
        self.drift = 0.0  # how much faster the remote clock runs; 1e-6 is 1 ppm
        self.shortest = 0.0  # the shortest round trip of the latest, s
        self._reference = self._offset = 0.0
        self._covariance = np.zeros((2, 2))

    @property
    def known(self) -> bool:
        """Whether there was any answer yet."""
        return bool(self._trips)

    def take(self, trip: RoundTrip) -> None:
        """Takes a round trip. Three in a row that contradict all before begin anew: another clock, or a sleep."""
        off, allowed = abs(trip.offset - self.offset(trip.middle)), 0.5 * trip.seconds + _SLACK
        if self._trips and off > allowed + self.uncertainty(trip.middle):
            self._contradicting.append(trip)
            if len(self._contradicting) < _CONTRADICTIONS:
                return
            self._trips.clear()
            self._trips.extend(self._contradicting)
        else:
            self._trips.append(trip)
        self._contradicting.clear()
        while self._trips[-1].middle - self._trips[0].middle > WINDOW:
            self._trips.popleft()
        self._fit()

    def offset(self, local: float) -> float:
        """By how much the remote clock is ahead at a local time, s."""
        return self._offset + self.drift * (local - self._reference)

    def remote(self, local: float) -> float:
        """The remote time at a local time, s."""
        return local + self.offset(local)

    def local(self, remote: float) -> float:
        """The local time at a remote time, s."""
        return self._reference + (remote - self._reference - self._offset) / (1.0 + self.drift)

    def uncertainty(self, local: float) -> float:
        """How far the remote time at a local time may be off, s."""
        ahead = np.array([1.0, local - self._reference])
        return 0.5 * self.shortest + 2.0 * float(np.sqrt(ahead @ self._covariance @ ahead))

    def _fit(self) -> None:
        middles = np.array([trip.middle for trip in self._trips])
        offsets = np.array([trip.offset for trip in self._trips])
        delays = np.array([trip.seconds for trip in self._trips])
        self._reference, self.shortest = float(middles[-1]), float(delays.min())
        waited, ages = 0.5 * (delays - self.shortest), self._reference - middles
        weights = 1.0 / (JITTER**2 * (1.0 + (waited / JITTER) ** 2) ** 1.5 + (WANDER * ages) ** 2)
        columns = np.column_stack([np.ones_like(middles), -ages])
        first = float(offsets[-1])  # of about the same size as all, so that no digits are lost
        normal = columns.T @ (weights[:, None] * columns) + np.diag([0.0, DRIFT**-2])
        self._covariance = np.linalg.inv(normal)
        line = self._covariance @ (columns.T @ (weights * (offsets - first)))
        self._offset, self.drift = first + float(line[0]), float(line[1])
