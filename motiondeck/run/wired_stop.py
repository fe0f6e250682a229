"""A wired emergency stop, polled once a tick."""

from __future__ import annotations

import sys
from typing import Protocol

from controller.loop.commands.command_handler import CommandHandler
from controller.loop.stop_requests import StopRequest
from controller.wire.messages.commands import EmergencyStop


class WiredStop(Protocol):
    """An emergency stop that is wired."""

    name: str
    pulled: bool
    pulls: int

    def close(self) -> None:
        """Closes its device."""
        ...


class WiredStopWatch:
    """Stops while the wired stop is pulled, or if it was since the last poll; until then a reset has no effect."""

    def __init__(self, wired: WiredStop, desk: CommandHandler) -> None:
        self._wired, self._desk, self._pulls = wired, desk, 0

    def poll(self, stop: StopRequest) -> None:
        """Commands the emergency stop if it has to."""
        wired, desk = self._wired, self._desk
        before, self._pulls = self._pulls, wired.pulls
        if stop.emergency or not (wired.pulled or self._pulls != before):
            return
        desk.carry_out(EmergencyStop(), stop)
        desk.tell("fault", f"the emergency stop at {wired.name} was pulled")
        print(f"motiondeck: the emergency stop at {wired.name} was pulled", file=sys.stderr)
