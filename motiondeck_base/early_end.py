"""Signals that ask a program to end before a run has begun, which then takes signals itself."""

import signal
import sys

_asked = 0


def take_signals() -> None:
    """Makes SIGTERM and SIGHUP end the program with one line, unless they are handled or ignored already."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, _end)


def end_if_asked() -> None:
    """Ends the program if a signal has asked for it."""
    # Where Python calls the handler from inside an import or a callback, what it raises may be caught there.
    if _asked:
        sys.exit(128 + _asked)


def _end(number: int, frame: object) -> None:
    global _asked
    if not _asked:
        print(f"motiondeck: ended by {signal.Signals(number).name}", file=sys.stderr)
    _asked = number
    sys.exit(128 + number)
