"""Stop requests: end the run, emergency stop, stand at home. Ctrl-C and kill end a run, a second one at once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from controller.wire.messages.deck_snapshot import Mode
from motiondeck_base.early_end import end_if_asked
from motiondeck_base.errors import MotiondeckError


class EmergencyStopError(MotiondeckError):
    """A command that the present emergency-stop state does not allow."""


@dataclass
class StopRequest:
    """Whether the run is to end and why, and the mode of the joints until then.

    Attributes:
        mode: whether the joints follow the deck, stand at home, are held, or are held by the emergency stop.
        at_rest: whether the joints have come to rest where they are held; set by the loop.
        approaching: whether the joints are on their slow way to the motion, whose time waits; set by the loop.
        presses: how often the emergency stop was commanded, while it was on too.
        then: the library file and the motion to start again with, if that was asked for.
    """

    reason: str = ""
    mode: Mode = "playing"
    at_rest: bool = False
    approaching: bool = False
    presses: int = 0
    then: tuple[str, str] | None = None

    @property
    def emergency(self) -> bool:
        """Whether the emergency stop is on."""
        return self.mode == "emergency stop"

    @property
    def holds(self) -> bool:
        """Whether nothing is to move: by the emergency stop, or after it until somebody lets the joints go on."""
        return self.mode in ("emergency stop", "held")

    def emergency_stop(self) -> None:
        """Sets the emergency stop: the joints brake from this tick on and stay where they come to rest."""
        self.mode, self.at_rest = "emergency stop", False
        self.presses += 1

    def reset(self) -> None:
        """Releases the emergency stop; the joints stay where they are.

        Raises:
            EmergencyStopError: if it is not on, or the joints have not come to rest yet.
        """
        if not self.emergency:
            raise EmergencyStopError("the emergency stop is not on, so there is nothing to reset")
        if not self.at_rest:
            raise EmergencyStopError("the joints are still braking; reset the emergency stop when they are at rest")
        self.mode = "held"

    def play(self) -> None:
        """Lets the joints follow the deck, after a slow approach if they do not follow it already.

        Raises:
            EmergencyStopError: if the emergency stop is on.
        """
        self.check_released()
        self.mode = "playing"

    def go_home(self) -> None:
        """Sends the joints to the rest pose; raises an EmergencyStopError if the emergency stop is on."""
        self.check_released()
        self.mode = "home"

    def check_released(self) -> None:
        """Checks that the joints may be moved; raises an EmergencyStopError if the emergency stop is on."""
        if self.emergency:
            raise EmergencyStopError("the emergency stop is on; release it with: reset")

    def ask(self, reason: str) -> None:
        """Asks for a controlled end of the run; the first reason is kept."""
        self.reason = self.reason or reason

    def __bool__(self) -> bool:
        return bool(self.reason)


SIGNALS = {
    signal.SIGINT: "Ctrl-C was pressed",
    signal.SIGTERM: "stopped from outside (SIGTERM)",
    signal.SIGHUP: "the terminal was closed (SIGHUP)",
}
"""The signals that end a run, and what is then given as the reason."""


@contextmanager
def stop_on_signals() -> Iterator[StopRequest]:
    """A request that SIGINT, SIGTERM and SIGHUP set; the next signal raises KeyboardInterrupt.

    Outside the main thread Python handles no signals, and the request is set by the caller alone.

    Raises:
        SystemExit: if a signal has come before.
    """
    end_if_asked()
    request = StopRequest()
    if threading.current_thread() is not threading.main_thread():
        yield request
        return
    interrupted = False

    def on_signal(number: int, frame: object) -> None:
        nonlocal interrupted
        if interrupted:
            raise KeyboardInterrupt
        interrupted = True
        request.ask(SIGNALS[signal.Signals(number)])

    before = {number: signal.signal(number, on_signal) for number in SIGNALS}
    try:
        yield request
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
