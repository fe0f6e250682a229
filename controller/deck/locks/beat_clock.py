"""A beat clock: a phase-locked loop that learns period and phase of a beat from the times of single beats.

It predicts the next beat at s + P and corrects both by the error e of the prediction, at the beat with time t:

    e = t - (s + n P),    s <- s + n P + g e,    P <- P + h e / n        (n periods since the last beat)

This is the second-order sampled loop (Lindsey and Chie, "A survey of digital phase-locked loops", Proc. IEEE 69, 1981):
a constant period leaves no error, and one that changes by D at each beat an error of D / h. For n = 1 the errors obey

    e(k+1) - (2 - g - h) e(k) + (1 - g) e(k-1) = 0,

and both roots are r for  g = 1 - r^2,  h = (1 - r)^2: critically damped (the fading-memory filter of Brookner,
"Tracking and Kalman Filtering Made Easy", 1998, section 1.2). The first beats weigh more, as in the line of least
squares through all k + 1 of them (the growing-memory filter, ibid.): g = 2 (2k + 1) / ((k + 1)(k + 2)),
h = 6 / ((k + 1)(k + 2)).

Capture range: the first two beats give the period, so every beat from 40 to 240 a minute is captured. Once it runs,
a beat counts when it is off by at most GATE of a period; two strays that could be a beat of their own begin it anew,
and so do three intervals that are alike and no whole number of periods: at some ratios of a new tempo to the old one,
two of three beats fall near the old beat.
"""

from controller.motion.clip import nearest

SHORTEST, LONGEST = 0.25, 1.5  # periods that are captured, s: 240 to 40 beats a minute
# Where times are whole ms, as they are given, no beat lies just at one of these limits.
GATE = 0.30013  # a beat that is off by more, in periods, is ignored
# Intervals that differ by less are alike, of their length; off from whole numbers of periods, of a period.
ALIKE, OFF = 0.10013, 0.20013
MOST_LOST = 8  # periods without a beat after which the next two beats begin it anew
_ROOT = 0.7
_GAIN, _PERIOD_GAIN = 1.0 - _ROOT**2, (1.0 - _ROOT) ** 2
_SLACK = 0.02013  # of the limits of captured periods, which a beat at the limit and a tick of rounding still keep


class BeatClock:
    """Follows a beat; all times are those of one clock, s."""

    def __init__(self) -> None:
        self.period: float | None = None  # the estimated period, s, or None before the second beat
        self.last = 0.0  # the estimated time of the latest beat
        self.counted = 0  # how many beats were where they could be expected, from the first one on
        self._before = 0.0  # the time of the latest beat, a stray or not
        self._strays = 0  # strays that were as far from the beat before as beats can be
        self._was_stray = False
        self._interval = 0.0  # between the latest two beats, strays or not
        self._steady = 0  # intervals in a row that were no whole number of periods, but alike

    def beat(self, time: float) -> None:
        """Takes a beat; double taps and strays are left out. Beats may be lost, and a few may be out of order."""
        before, self._before = self._before, time
        if not self.counted:
            self._begin(time)
        elif self.counted == 1 or self.period is None:
            self._take_second(time)
        else:
            self._take(time, before, self.period)

    def _take(self, time: float, before: float, period: float) -> None:
        """Takes a beat while a period is known; `before` is the time of the latest beat, a stray or not."""
        since = time - self.last
        periods = nearest(since / period)
        error = since - periods * period
        if periods > MOST_LOST:
            self._begin(time)
        elif self._is_steady_at_another_tempo(time - before, period):
            self._begin(before)
            self._take_second(time)
        elif periods < 1 or abs(error) > GATE * period:
            self._was_stray = True
            self._strays += _captured(time - before)
            if self._strays > 1:
                self._begin(before)
                self._take_second(time)
        else:
            gain, period_gain = self._gains()
            self.last = time - (1.0 - gain) * error
            self.period = min(max(period + period_gain * error / periods, SHORTEST), LONGEST)
            self.counted += 1
            self._strays = self._strays if self._was_stray else 0
            self._was_stray = False

    def _is_steady_at_another_tempo(self, interval: float, period: float) -> bool:
        """Whether the latest three intervals, of which this is the last, are alike and no whole number of periods."""
        whole = max(nearest(interval / period), 1)
        off = abs(interval - whole * period) > OFF * period
        alike = abs(interval - self._interval) < ALIKE * interval
        self._steady = self._steady + 1 if off and alike else 0
        self._interval = interval
        return self._steady > 1 and _captured(interval)

    def _begin(self, time: float) -> None:
        """Takes a beat for the first one; the period so far stays until there is another."""
        self.last, self.counted, self._strays, self._was_stray, self._steady = time, 1, 0, False, 0

    def _take_second(self, time: float) -> None:
        since = time - self.last
        if _captured(since):
            self.period, self.last, self.counted = min(max(since, SHORTEST), LONGEST), time, 2
        elif since > LONGEST:
            self._begin(time)

    def _gains(self) -> tuple[float, float]:
        k = self.counted  # this is beat number k, counted from 0
        both = (k + 1) * (k + 2)
        return max(_GAIN, 2.0 * (2 * k + 1) / both), max(_PERIOD_GAIN, 6.0 / both)


def _captured(interval: float) -> bool:
    return SHORTEST * (1.0 - _SLACK) <= interval <= LONGEST * (1.0 + _SLACK)
