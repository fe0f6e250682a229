"""Lines of standard input, with a timeout or without."""

import io
import os
import select
import sys

from motiondeck_base.errors import MotiondeckError


class LineInput:
    """Reads lines from standard input; prompts go to standard error, because standard output carries the result."""

    def __init__(self) -> None:
        self._partial = b""
        try:
            self._fd: int | None = sys.stdin.fileno()
        except (io.UnsupportedOperation, AttributeError):
            self._fd = None  # a stream without a descriptor never blocks

    def ask(self, prompt: str) -> str:
        """Prompts for a line, which is returned without surrounding spaces; MotiondeckError at the input's end."""
        print(prompt, end="", file=sys.stderr, flush=True)
        while (line := self.take(None)) is None:
            pass
        return line

    def take(self, seconds: float | None = 0.0) -> str | None:
        """The next line, or None if none comes within `seconds` (None: for ever); MotiondeckError at the end."""
        if self._fd is None:
            return self._ended_or(sys.stdin.readline())
        if b"\n" not in self._partial:
            if not select.select([self._fd], [], [], seconds)[0]:
                return None
            data = os.read(self._fd, 4096)
            self._partial += data
            if b"\n" not in self._partial:
                return self._ended_or("") if not data else None
        line, _, self._partial = self._partial.partition(b"\n")
        return line.decode(errors="replace").strip()

    @staticmethod
    def _ended_or(line: str) -> str:
        if not line:
            raise MotiondeckError("standard input has ended, so there is no Enter; --help shows what works without it")
        return line.strip()


def in_foreground() -> bool:
    """Whether standard input may be read: it is no terminal, or this process is in its foreground."""
    try:
        return not sys.stdin.isatty() or os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except (OSError, ValueError, AttributeError):
        return False
