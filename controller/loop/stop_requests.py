"""Stop requests: end the run, emergency stop, stand at home. Ctrl-C and kill end a run, a second one at once."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from controller.loop.stop_state import StopState
from controller.wire.messages.deck_snapshot import Mode


@dataclass
class StopRequest:
    """Whether the run is to end and why, and what the joints do until then."""

    reason: str = ""
    state: StopState = field(default_factory=StopState)  # the emergency stop
    home: bool = False  # whether the joints stand at home instead of following the deck
    # Whether the joints are on their slow way to the motion, whose time waits; set by the loop.
    approaching: bool = False
    then: tuple[str, str] | None = None  # the library file and the motion to start again with, if that was asked for

    @property
    def mode(self) -> Mode:
        """Whether the joints follow the deck, stand at home, are held, or are held by the emergency stop."""
        if self.state.phase == "running":
            return "home" if self.home else "playing"
        return "emergency stop" if self.state.stopped else "held"

    @property
    def emergency(self) -> bool:
        """Whether the emergency stop is on."""
        return self.state.stopped

    @property
    def holds(self) -> bool:
        """Whether nothing is to move: by the emergency stop, or after it until the joints are let go on."""
        return self.state.phase != "running"

    def play(self) -> None:
        """Lets the joints follow the deck, after a slow approach if needed; EmergencyStopError if that stop is on."""
        self.state.go_on()
        self.home = False

    def go_home(self) -> None:
        """Sends the joints to the rest pose; raises an EmergencyStopError if the emergency stop is on."""
        self.state.go_on()
        self.home = True

    def ask(self, reason: str) -> None:
        """Asks for a controlled end of the run; the first reason is kept."""
        self.reason = self.reason or reason

    def __bool__(self) -> bool:
        return bool(self.reason)


SIGNALS = {  # that end a run, and what is then given as the reason
    signal.SIGINT: "Ctrl-C was pressed",
    signal.SIGTERM: "stopped from outside (SIGTERM)",
    signal.SIGHUP: "the terminal was closed (SIGHUP)",
}


@contextmanager
def stop_on_signals() -> Iterator[StopRequest]:
    """A request that SIGINT, SIGTERM and SIGHUP set; the next signal raises KeyboardInterrupt.

    Outside the main thread Python handles no signals, and the request is set by the caller alone.
    """
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
