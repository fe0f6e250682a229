"""Stop requests: to end, to halt at once, to stand at home. Ctrl-C and kill end a loop, asked a second time at once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from controller.wire.messages import Mode
from motiondeck_base.errors import MotiondeckError


class HaltedError(MotiondeckError):
    """What cannot be done while, or because, the emergency stop is or is not on."""


@dataclass
class StopRequest:
    """Whether the loop is to end and why, and where the joints are to be meanwhile.

    Attributes:
        reason: why it is to end; empty while nobody has asked.
        mode: whether the joints follow what is played, stand at home, are held, or are held by the emergency stop.
        halted: whether the joints have come to rest where they are held; the loop says so.
    """

    reason: str = ""
    mode: Mode = "playing"
    halted: bool = False

    @property
    def emergency(self) -> bool:
        """Whether the emergency stop is on."""
        return self.mode == "emergency stop"

    def halt(self) -> None:
        """Puts the emergency stop on: the joints brake in this very tick and stay where they come to rest."""
        self.mode, self.halted = "emergency stop", False

    def reset(self) -> None:
        """Releases the emergency stop; the joints stay where they are.

        Raises:
            HaltedError: if it is not on, or the joints have not come to rest yet.
        """
        if not self.emergency:
            raise HaltedError("the emergency stop is not on, so there is nothing to reset")
        if not self.halted:
            raise HaltedError("the joints are still braking; reset the emergency stop when they are at rest")
        self.mode = "held"

    def play(self) -> None:
        """Lets the joints follow what is played, after a slow approach if they do not.

        Raises:
            HaltedError: if the emergency stop is on.
        """
        self.check_released()
        self.mode = "playing"

    def go_home(self) -> None:
        """Sends the joints to the rest pose.

        Raises:
            HaltedError: if the emergency stop is on.
        """
        self.check_released()
        self.mode = "home"

    def check_released(self) -> None:
        """Checks that the joints may be moved.

        Raises:
            HaltedError: if the emergency stop is on.
        """
        if self.emergency:
            raise HaltedError("the emergency stop is on; release it with: reset")

    def ask(self, reason: str) -> None:
        """Asks for a controlled stop; the first reason stays."""
        self.reason = self.reason or reason

    def __bool__(self) -> bool:
        return bool(self.reason)


@contextmanager
def stop_on_signals() -> Iterator[StopRequest]:
    """A request that SIGINT, SIGTERM and SIGHUP set; a signal after that raises KeyboardInterrupt where the program is.

    Outside the main thread, where Python takes no signals, the request is nobody's but the caller's.
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
        request.ask(f"{signal.Signals(number).name} received")

    before = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield request
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
