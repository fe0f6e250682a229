"""What a deck should be doing by now: the commands that one gets which joins late or has missed some."""

from __future__ import annotations

from controller.wire.messages.commands import Blend, DeckCommand, Home, Jump, Pause, Push, Resume, Stop, Switch
from motiondeck.shows.messages import CommonRound, TimedCue


class Standing:
    """Sums up the cues of one deck.

    Attributes:
        number: of the latest cue; 0 before the first.
        at: when it is carried out, in the conductor's time, s.
    """

    def __init__(self) -> None:
        self.number, self.at = 0, 0.0
        self._commands: list[DeckCommand] = []
        self._step: CommonRound | None = None

    def take(self, cue: TimedCue) -> None:
        """Takes a cue that was sent."""
        self.number, self.at = cue.number, cue.at
        for command in cue.say:
            if isinstance(command, Switch | Blend | Home | Stop):  # nothing before it matters any more
                self._commands, self._step = [], None
            if isinstance(command, Pause | Resume):
                self._commands = [before for before in self._commands if not isinstance(before, Pause | Resume)]
            if not isinstance(command, Jump | Push | Stop):
                self._commands.append(command)
        if cue.step is not None:
            self._step = cue.step

    def cue(self, run: str, deck: str, at: float) -> TimedCue:
        """The cue that brings a deck there."""
        return TimedCue(run, self.number, "joins", at, [deck], list(self._commands), self._step)
