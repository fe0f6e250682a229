"""Another deck as a reference: two robots in step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from controller.deck.locks.lock import LoopPlace
from controller.deck.locks.phase_error import wrapped
from controller.deck.locks.phase_lock import Reference
from controller.wire.leader_link import Sighting

Leader = Callable[[float], Sighting | None]
"""What has been seen of another deck since the last call, at a time of this deck's clock, s."""

GAIN = 0.3
"""How much of the error of the predicted phase each sighting corrects: the time of one is known to a tick or two."""

FORGOTTEN_AFTER = 1.0
"""Without sightings for so long the other deck is lost, and the motion keeps its tempo, s."""


class OtherDeck:
    """A loop of another deck; fits `phase_lock.ReferenceSource`.

    Between sightings the phase goes on at the rate that was seen last. A motion of another length is brought to the
    same rounds a second.

    Args:
        leader: sees the other deck.
        ahead: by how much of a round to be ahead of it, in [0, 1].
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
        """A new sighting, and what was to be expected of it."""
        old = self._seen
        if old is None or new.time - old.time > FORGOTTEN_AFTER:
            return new
        expected = old.phase + 0.5 * (old.rate + new.rate) * (new.time - old.time)
        error = wrapped(new.phase - expected)
        # One that has jumped is not averaged.
        return new if abs(error) > 0.1 else Sighting(new.time, expected + GAIN * error, new.rate)
