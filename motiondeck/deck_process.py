# pyright: strict
"""The process of a live deck: its ready message, its report, and its end."""

import contextlib
import os
import subprocess
import threading
from typing import Any

import msgspec

from motiondeck.run.live_deck import Ended, Failed, LiveMessage, Ready
from motiondeck_base.errors import MotiondeckError

_ENDS_WITHIN = 30.0  # s: on the way to rest a rig may take its time

_news = msgspec.json.Decoder(LiveMessage)


class DeckProcess:
    """A process that has been started to play.

    It has pipes to its standard input, which keeps it alive, and from its output. Its end closes what was `opened`.
    """

    def __init__(self, process: subprocess.Popen[bytes], opened: contextlib.ExitStack) -> None:
        """Waits until it plays. MotiondeckError if it cannot begin, and why."""
        self._process, self._opened = process, opened
        self._starter = os.getpid()
        self.report: dict[str, Any] | None = None  # how the run went; None until it has ended
        assert process.stdout is not None
        self._stdout = process.stdout
        first = self._stdout.readline()
        ready = _news.decode(first) if first else None
        # A report may be longer than the pipe holds, so a thread reads it while the deck ends.
        self._reader = threading.Thread(target=self._read_report, daemon=True)
        self._reader.start()
        if not isinstance(ready, Ready):
            self.end()
            raise MotiondeckError(ready.reason if isinstance(ready, Failed) else self.how_it_ended)
        self.ready = ready  # the port for commands, the page's, and the motions

    @property
    def in_fork(self) -> bool:
        """Whether this is a fork of the process that started it: only that one can wait for it."""
        return os.getpid() != self._starter

    @property
    def running(self) -> bool:
        """Whether it still plays."""
        return self._process.poll() is None

    def wait(self, timeout: float | None) -> bool:
        """Waits up to `timeout` seconds for its end, without a limit if None; whether it has ended."""
        try:
            self._process.wait(timeout)  # the report is read by the thread meanwhile
        except subprocess.TimeoutExpired:
            return False
        return True

    def end(self) -> None:
        """Waits for it and takes its report; it is killed if it does not end. May be called twice."""
        if not self.wait(_ENDS_WITHIN):
            self._process.kill()
            self._process.wait()
        self._reader.join()
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._stdout.close()
        self._opened.close()

    @property
    def how_it_ended(self) -> str:
        """Why it has ended, as far as that is known."""
        if self.report is not None:
            return f"the deck has ended: {self.report['reason']}"
        code = self._process.returncode
        return f"the deck's process broke off with exit code {code}; its own message stands above"

    def _read_report(self) -> None:
        """Keeps the report that the process prints in the end."""
        for line in self._stdout:
            news = _news.decode(line)
            if isinstance(news, Ended):
                self.report = news.report
