"""Processes of this program that a run starts and that end with it; they never import from the working directory."""

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
    """Runs a module beside the block; after the block it has some seconds to end, then it is killed.

    Args:
        module: its name.
        arguments: its command line.
        patience: how long it may take to end, s.
        own_session: keeps Ctrl-C from it, which is for the deck alone.
    """
    child = subprocess.Popen([sys.executable, "-P", "-m", module, *arguments], start_new_session=own_session)
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
    """Restores the settings of the terminal after the block, whatever a killed prompt has done to them.

    Yields a function that restores them before that.
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
