"""Timed commands: kept until the tick that is due at their time."""

from collections.abc import Iterator

import msgspec

from controller.loop.commands.interfaces import Client, RealTime
from controller.wire.messages.commands import AtTime, DeckCommand
from motiondeck_base.errors import MotiondeckError

_AHEAD = 60.0  # s, the most ahead of its time
_MOST_TIMED = 64  # commands whose time is still to come


class TimedCommands:
    """The commands whose time is still to come, by the loop's clock; without one (not in real time) none is taken."""

    def __init__(self, ticks: RealTime | None) -> None:
        self._ticks = ticks
        self.waiting: list[tuple[Client, AtTime]] = []

    def check(self, message: AtTime, *, remote: bool) -> None:
        """Checks that one more can be kept; the MotiondeckError says why not."""
        if self._ticks is None or remote:
            raise MotiondeckError("commands for a time are given by programs of this machine, on a deck in real time")
        if message.when > self._ticks.due() + _AHEAD:
            raise MotiondeckError(f"a command is given at most {_AHEAD:g} s ahead of its time")
        if len(self.waiting) >= _MOST_TIMED:
            raise MotiondeckError(f"{_MOST_TIMED} commands wait for their time already")

    def add(self, client: Client, message: AtTime) -> None:
        """Keeps one until its time."""
        self.waiting.append((client, message))

    def take_due(self) -> Iterator[tuple[Client, DeckCommand]]:
        """Takes those whose time is nearer to this tick than to the next one, in order, of clients still connected.

        A command has the number with which it was given.
        """
        assert self._ticks is not None, "else none is taken"
        until = self._ticks.due() + 0.5 * self._ticks.period
        due = sorted((timed for timed in self.waiting if timed[1].when <= until), key=lambda timed: timed[1].when)
        self.waiting = [timed for timed in self.waiting if timed[1].when > until]
        for client, message in due:
            if client.connected:
                yield client, msgspec.structs.replace(message.say, id=message.id)
