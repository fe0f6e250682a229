"""What the recordings of several decks say about each other, on one clock."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.wire.messages.deck_snapshot import MODES
from controller.wire.run_recording import load_recording

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RecordedDeck:
    """One recording.

    Attributes:
        times: true time at which each tick began, s: that of the clock of this machine that nothing skews.
        due: true time at which it was due, s; of several that were missed the last one, in whose place it is.
        fields: of the recording, one value a tick.
        motions: the names of the motions.
    """

    times: Array
    due: Array
    fields: dict[str, Array]
    motions: list[str]

    @classmethod
    def read(cls, file: Path, offset: float, ppm: float) -> RecordedDeck:
        """Reads it, and takes the skew off its clock."""
        run = load_recording(file)
        fields = {name: values[:, 0] for name, values in run.fields.items() if values.shape[1] == 1}
        times = (fields["clock_s"] - offset) / (1.0 + 1e-6 * ppm)
        due = times - 1e-6 * fields["late_us"] % (1.0 / run.description["rate"])
        return cls(times, due, fields, run.description["motions"])

    def played(self, motion: str, after: float) -> tuple[float, float]:
        """When the tick began with which a motion was first played after a time, and when it was due, s; else NaN."""
        ticks = np.flatnonzero((self.fields["playing"] == self.motions.index(motion)) & (self.times > after))
        if not len(ticks):
            return np.nan, np.nan
        return float(self.times[ticks[0]]), float(self.due[ticks[0]])

    def stopped(self, after: float) -> float:
        """When the emergency stop came, s; NaN if it did not."""
        at = self.times[(self.fields["mode"] == MODES.index("emergency stop")) & (self.times > after)]
        return float(at[0]) if len(at) else np.nan

    def phases(self, times: Array, *, by_due: bool = False) -> Array:
        """The phase at some times, not wrapped, as if ticks began when they did or when due; NaN without a record."""
        known = np.isfinite(self.fields["phase"])
        unwrapped = np.unwrap(self.fields["phase"][known], period=1.0)
        at = (self.due if by_due else self.times)[known]
        return np.interp(times, at, unwrapped, left=np.nan, right=np.nan)

    def still(self, after: float) -> float:
        """When the tempo was 0 for the first time after a time, s; NaN if never."""
        at = self.times[(np.abs(self.fields["tempo"]) < 1e-3) & (self.times > after)]
        return float(at[0]) if len(at) else np.nan


def apart_ms(decks: list[RecordedDeck], times: Array, round_s: float, *, by_due: bool = False) -> Array:
    """How far the phases of decks are apart at most at each of some times, ms."""
    phases = np.array([deck.phases(times, by_due=by_due) for deck in decks])
    off = phases - phases[0]
    off -= np.round(off)
    return 1e3 * round_s * (off.max(axis=0) - off.min(axis=0))


def undisturbed(times: Array, stalls: Array, longest: float = 0.005, for_s: float = 1.0) -> NDArray[np.bool_]:
    """At which of some times there was no stall of the machine, rows (end, seconds), in the last second."""
    free = np.ones(len(times), dtype=bool)
    for end, seconds in stalls[stalls[:, 1] > longest]:
        free &= ~((times > end - seconds) & (times < end + for_s))
    return free


def longest_beyond(apart: Array, step: float, most: float = 10.0) -> float:
    """For how long decks were farther apart at a stretch than so many ms, at most, s; values are `step` s apart."""
    within = np.flatnonzero(np.r_[True, apart <= most, True])
    return step * float(np.diff(within).max() - 1)


def in_step_since(deck: RecordedDeck, leader: RecordedDeck, after: float, until: float, round_s: float) -> float:
    """From when on a deck is within 10 ms of another until the end, s; NaN if it never is."""
    times = np.arange(after, until, 0.01)
    off = leader.phases(times) - deck.phases(times)
    away = ~(np.abs(off - np.round(off)) * round_s < 0.01)
    if away[-1]:
        return np.nan
    return float(times[np.flatnonzero(away)[-1]]) if away.any() else after
