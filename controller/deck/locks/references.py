"""What the phase of a motion is locked to: beats, the loop of another deck, or a person."""

import math
from collections.abc import Callable
from typing import Literal

from controller.deck.locks.beat_clock import BeatClock
from controller.deck.locks.phase_lock import LoopPlace, Reference, wrapped
from controller.wire.leader_link import Sighting

STEADY_BEATS = 4  # beats after which the period counts as known
SILENT_AFTER = 4.0  # periods without a beat after which it counts as silent; the motion keeps its tempo
_RANGE = 0.75  # the steps of a round change where the tempo would be further than this from 1, in octaves


class Beats:
    """Beats, and the phase of a loop that falls on them, in [0, 1]; fits `phase_lock.ReferenceSource`.

    A round has `steps` beats, evenly spread; 0 takes 1, 2, 4, 8 or 16, whichever tempo is nearest to 1.
    """

    name: Literal["beat"] = "beat"

    def __init__(self, phase: float = 0.0, steps: int = 0) -> None:
        self.clock = BeatClock()
        self._phase, self._steps = phase, steps
        self._chosen = 0

    @property
    def per_minute(self) -> float | None:
        """Beats a minute."""
        return 60.0 / self.clock.period if self.clock.period is not None else None

    def reference(self, playhead: LoopPlace) -> Reference | None:
        """The phase that the beat asks for; without beats it goes on with the period that it had."""
        clock = self.clock
        if clock.period is None:
            return None
        steps = self._steps or self._choose(playhead.seconds / clock.period)
        beats = (playhead.time - clock.last) / clock.period
        steady = clock.counted >= STEADY_BEATS and beats < SILENT_AFTER
        return Reference(self._phase + beats / steps, 1.0 / (steps * clock.period), 1.0 / steps, steady)

    def _choose(self, beats: float) -> int:
        """The steps of a round that takes this number of beats at tempo 1."""
        if not self._chosen or abs(math.log2(beats / self._chosen)) > _RANGE:
            self._chosen = 2 ** min(max(round(math.log2(beats)), 0), 4)
        return self._chosen


# What has been seen of another deck since the last call, at a time of this deck's clock, s.
Leader = Callable[[float], Sighting | None]
GAIN = 0.3  # of the error of the predicted phase each sighting corrects: its time is known to a tick or two
FORGOTTEN_AFTER = 1.0  # without sightings for so long the other deck is lost, and the motion keeps its tempo, s


class OtherDeck:
    """A loop of another deck, to be ahead of by a part of a round, in [0, 1]; fits `phase_lock.ReferenceSource`.

    Between sightings the phase goes on at the last rate. A motion of another length gets the same rounds a second.
    """

    name: Literal["deck"] = "deck"
    per_minute: None = None

    def __init__(self, leader: Leader, ahead: float = 0.0) -> None:
        self._leader, self._ahead = leader, ahead
        self._seen: Sighting | None = None

    def reference(self, playhead: LoopPlace) -> Reference | None:
        """The other deck's phase now, and how fast it turns."""
        new = self._leader(playhead.time)
        if new is not None:
            self._seen = self._corrected(new)
        seen = self._seen
        if seen is None:
            return None
        since = playhead.time - seen.time
        return Reference(seen.phase + self._ahead + seen.rate * since, seen.rate, steady=since < FORGOTTEN_AFTER)

    def _corrected(self, new: Sighting) -> Sighting:
        old = self._seen
        if old is None or new.time - old.time > FORGOTTEN_AFTER:
            return new
        expected = old.phase + 0.5 * (old.rate + new.rate) * (new.time - old.time)
        error = wrapped(new.phase - expected)
        # One that has jumped is not averaged.
        return new if abs(error) > 0.1 else Sighting(new.time, expected + GAIN * error, new.rate)


LET_GO_AFTER = 0.5  # without a sighting for so long the motion plays on at the commanded tempo, s
_LAST = 1.0 - 1e-6  # a phase of 1 would be that of the beginning


class Person:
    """A person that leads, seen now and then in a motion; fits `phase_lock.ReferenceSource`."""

    name: Literal["person"] = "person"
    per_minute: None = None

    def __init__(self) -> None:
        self._motion, self._phase, self._tempo, self._time = "", 0.0, 1.0, -math.inf

    def see(self, time: float, motion: str, phase: float, tempo: float) -> None:
        """Takes the place in a motion, and the tempo, at a time of this deck's clock, s."""
        self._motion, self._phase, self._tempo, self._time = motion, phase, tempo, time

    def reference(self, playhead: LoopPlace) -> Reference | None:
        """The person's phase now; None while they do something else, or were not seen for LET_GO_AFTER."""
        since = playhead.time - self._time
        if playhead.motion != self._motion or since > LET_GO_AFTER:
            return None
        rate = self._tempo / playhead.seconds
        phase = self._phase + rate * since
        return Reference(
            phase if playhead.loop else min(max(phase, 0.0), _LAST), rate, once=not playhead.loop, turns_back=True
        )
