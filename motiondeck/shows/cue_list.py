"""The cue list: which cue is next, and whether its time has come; pure, with time from outside."""

from collections.abc import Callable, Sequence

from motiondeck.shows.show_file import Condition, ShowCue
from motiondeck_base.errors import UnknownNameError

Holds = Callable[[Condition, ShowCue], bool]  # whether a condition holds for the decks of a cue


class CueList:
    """Goes through cues in order; `number`, from 0, is that of the next one.

    Times count from the beginning, and anew from every hold point and condition that was passed. A cue is given out
    `lead` seconds before its time; those of time 0 come that long after the beginning.
    """

    def __init__(self, cues: Sequence[ShowCue], lead: float, now: float, first: int = 0) -> None:
        self._cues, self._lead = cues, lead
        self.number = first
        self._zero = now + lead
        if 0 < first < len(cues) and (at := cues[first].at) is not None:
            self._zero -= at  # a show that begins later begins with its first cue
        self._waiting_since = now
        self._gone = False
        self._held = False
        self._expired = False

    @property
    def next(self) -> ShowCue | None:
        """The cue that comes next; None at the end."""
        return self._cues[self.number] if self.number < len(self._cues) else None

    @property
    def next_at(self) -> float | None:
        """When that cue comes, s; None if unknown yet."""
        cue = self.next
        return self._zero + cue.at if cue is not None and cue.at is not None and not self._held else None

    @property
    def waits(self) -> bool:
        """Whether only `go` brings the next cue."""
        cue = self.next
        return cue is not None and (self._held or ((cue.hold or self._expired) and not self._gone))

    def hold(self) -> None:
        """Stops before the next cue, until `go`."""
        self._held, self._gone = True, False

    def go(self, now: float) -> bool:
        """Ends a hold; False where there is none. A timed cue then comes at once, and others in their distance."""
        cue = self.next
        if cue is None or not self.waits:
            return False
        if self._held and cue.at is not None:
            self._zero = now + self._lead - cue.at
        else:
            self._gone = True
        self._held = False
        return True

    def due(self, now: float, holds: Holds) -> tuple[int, ShowCue, float] | None:
        """The number (from 0) of a cue that is to be sent now, the cue, and its time; call it until there is none."""
        cue = self.next
        if cue is None or self._held:
            return None
        if cue.at is not None:
            at = self._zero + cue.at
            if now < at - self._lead:
                return None
        elif self._gone or (cue.when is not None and not self._expired and holds(cue.when, cue)):
            at = self._zero = now + self._lead
        else:
            if cue.when is not None and cue.within is not None and now > self._waiting_since + cue.within:
                self._expired = True
            return None
        number = self.number
        self.number += 1
        self._gone = self._expired = False
        self._waiting_since = at
        return number, cue, max(at, now)


def cue_named(cues: Sequence[ShowCue], name: str) -> int:
    """The number, from 0, of a cue by its name or by its number from 1; raises an UnknownNameError if there is none."""
    names = [cue.name or str(number) for number, cue in enumerate(cues, start=1)]
    if name in names:
        return names.index(name)
    if name.isdecimal() and 0 < int(name) <= len(cues):
        return int(name) - 1
    raise UnknownNameError.among("cue", name, names)
