"""Stop requests: Ctrl-C and kill end a loop in a controlled stop; asked a second time, at once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass
class StopRequest:
    """Whether the loop is to end, and why.

    Attributes:
        reason: why; empty while nobody has asked.
    """

    reason: str = ""

    def ask(self, reason: str) -> None:
        """Asks for a controlled stop; the first reason stays."""
        self.reason = self.reason or reason

    def __bool__(self) -> bool:
        return bool(self.reason)


@contextmanager
def stop_on_signals() -> Iterator[StopRequest]:
    """A request that SIGINT and SIGTERM set; a signal after that raises KeyboardInterrupt where the program is.

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

    before = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield request
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
