"""Processes of this program that a run starts and that end with it."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import termios
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def child_process(
    module: str, *arguments: str, patience: float = 2.0, own_session: bool = False
) -> Iterator[subprocess.Popen[bytes]]:
    """Runs a module beside the block; after it the process has some seconds to end by itself, or is asked to end.

    Args:
        module: what to run.
        arguments: its command line.
        patience: s that it has to end by itself.
        own_session: keeps Ctrl-C from it, which is for the deck alone.
    """
    child = subprocess.Popen([sys.executable, "-m", module, *arguments], start_new_session=own_session)
    try:
        yield child
    except BaseException:
        child.terminate()
        raise
    finally:
        try:
            child.wait(patience)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()


@contextmanager
def kept_tty() -> Iterator[Callable[[], None]]:
    """Remembers how the terminal is set and leaves it so, whatever a prompt that was killed has done to it.

    Yields what sets it back before the end.
    """
    before = None
    with contextlib.suppress(termios.error, ValueError, OSError):
        before = termios.tcgetattr(sys.stdin)

    def restore() -> None:
        if before is not None:
            with contextlib.suppress(termios.error, ValueError, OSError):
                termios.tcsetattr(sys.stdin, termios.TCSANOW, before)

    try:
        yield restore
    finally:
        restore()
