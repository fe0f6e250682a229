"""Signals that ask a program to end: before a run, which then takes them itself, and while it starts others."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from traceback import walk_stack
from types import FrameType

Handler = Callable[[int, FrameType | None], object]


def take_signals() -> None:
    """Makes SIGTERM and SIGHUP end the program with one line, unless they are handled or ignored already."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, outside_imports(_end))


def outside_imports(handle: Handler) -> Handler:
    """A signal's handler that sends it again after an import, where what it raises passes for a missing package."""

    def handler(number: int, frame: FrameType | None) -> None:
        if any(one.f_code.co_filename == "<frozen importlib._bootstrap>" for one, _ in walk_stack(frame)):
            signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(number))  # which a run may take by then
            signal.setitimer(signal.ITIMER_REAL, 0.05)
        else:
            handle(number, frame)

    return handler


@contextmanager
def without_interrupts() -> Iterator[None]:
    """Blocks Ctrl-C in the block, for good in processes that are started there."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end(number: int, frame: FrameType | None) -> None:
    print(f"motiondeck: ended by {signal.Signals(number).name}", file=sys.stderr)
    sys.exit(128 + number)
