"""What the recordings of several decks say about each other, on one clock."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.wire.run_recording import MODES, load_recording

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RecordedDeck:
    """One recording.

    Attributes:
        times: true time of each tick, s: that of the clock of this machine that nothing skews.
        fields: of the recording, one value a tick.
        motions: the names of the motions.
    """

    times: Array
    fields: dict[str, Array]
    motions: list[str]

    @classmethod
    def read(cls, file: Path, offset: float, ppm: float) -> RecordedDeck:
        """Reads it, and takes the skew off its clock."""
        run = load_recording(file)
        fields = {name: values[:, 0] for name, values in run.fields.items() if values.shape[1] == 1}
        return cls((fields["clock_s"] - offset) / (1.0 + 1e-6 * ppm), fields, run.description["motions"])

    def played(self, motion: str, after: float) -> tuple[float, float]:
        """When the tick began with which a motion was first played after a time, and when it was due, s; else NaN."""
        ticks = np.flatnonzero((self.fields["motion"] == self.motions.index(motion)) & (self.times > after))
        if not len(ticks):
            return np.nan, np.nan
        begun = float(self.times[ticks[0]])
        return begun, begun - 1e-6 * float(self.fields["late_us"][ticks[0]])

    def stopped(self, after: float) -> float:
        """When the emergency stop came, s; NaN if it did not."""
        at = self.times[(self.fields["mode"] == MODES.index("emergency stop")) & (self.times > after)]
        return float(at[0]) if len(at) else np.nan

    def phases(self, times: Array) -> Array:
        """The phase at some times, not wrapped; NaN where nothing was recorded."""
        known = np.isfinite(self.fields["phase"])
        unwrapped = np.unwrap(self.fields["phase"][known], period=1.0)
        return np.interp(times, self.times[known], unwrapped, left=np.nan, right=np.nan)

    def still(self, after: float) -> float:
        """When the tempo was 0 for the first time after a time, s; NaN if never."""
        at = self.times[(np.abs(self.fields["tempo"]) < 1e-3) & (self.times > after)]
        return float(at[0]) if len(at) else np.nan


def apart_ms(decks: list[RecordedDeck], since: float, until: float, round_s: float) -> Array:
    """How far the phases of decks are apart at most, ms, every 10 ms."""
    times = np.arange(since, until, 0.01)
    phases = np.array([deck.phases(times) for deck in decks])
    off = phases - phases[0]
    off -= np.round(off)
    return 1e3 * round_s * (off.max(axis=0) - off.min(axis=0))


def in_step_since(deck: RecordedDeck, leader: RecordedDeck, after: float, until: float, round_s: float) -> float:
    """From when on a deck is within 10 ms of another until the end, s; NaN if it never is."""
    times = np.arange(after, until, 0.01)
    off = leader.phases(times) - deck.phases(times)
    away = ~(np.abs(off - np.round(off)) * round_s < 0.01)
    if away[-1]:
        return np.nan
    return float(times[np.flatnonzero(away)[-1]]) if away.any() else after
