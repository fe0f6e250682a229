"""Lines that somebody types while a rig is being read: taken without waiting, or waited for."""

from __future__ import annotations

import io
import os
import select
import sys

from motiondeck_base.errors import MotiondeckError


class TypedLines:
    """The lines of standard input; prompts go to standard error, because standard output carries the result."""

    def __init__(self) -> None:
        self._begun = b""
        try:
            self._fd: int | None = sys.stdin.fileno()
        except (io.UnsupportedOperation, AttributeError):
            self._fd = None  # a stream without a descriptor never keeps anybody waiting

    def ask(self, what: str) -> str:
        """Asks, and waits for a line; what was typed, without spaces around it.

        Raises:
            MotiondeckError: if the input has ended.
        """
        print(what, end="", file=sys.stderr, flush=True)
        while (line := self.take(None)) is None:
            pass
        return line

    def take(self, seconds: float | None = 0.0) -> str | None:
        """The next line if it is typed within so many seconds (None: for ever); None if not.

        Raises:
            MotiondeckError: if the input has ended.
        """
        if self._fd is None:
            return self._ended_or(sys.stdin.readline())
        if b"\n" not in self._begun:
            if not select.select([self._fd], [], [], seconds)[0]:
                return None
            data = os.read(self._fd, 4096)
            self._begun += data
            if b"\n" not in self._begun:
                return self._ended_or("") if not data else None
        line, _, self._begun = self._begun.partition(b"\n")
        return line.decode(errors="replace").strip()

    @staticmethod
    def _ended_or(line: str) -> str:
        if not line:
            raise MotiondeckError("there is no terminal in which to press Enter; see --help for what goes without")
        return line.strip()


def in_foreground() -> bool:
    """Whether standard input may be read: it is no terminal, or this process is in its foreground."""
    try:
        return not sys.stdin.isatty() or os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except (OSError, ValueError, AttributeError):
        return False
