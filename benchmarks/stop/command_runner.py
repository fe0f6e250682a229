"""Runs motiondeck command lines without the second that Python takes to start, and says when each began.

The process reads a command line (a JSON list of words) a line, prints the time (CLOCK_MONOTONIC, s) and then runs it
exactly as the command does; its exit code follows.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

_COMMAND = "from benchmarks.stop.command_runner import main; main()"


class CommandRunner:
    """Runs command lines in the folder of a deck; one that hangs is killed when the next is to run."""

    def __init__(self, environment: dict[str, str], root: Path) -> None:
        self._environment, self._root = environment, root
        self._start()

    def _start(self) -> None:
        self._under_way, self._said = False, b""
        self._process = subprocess.Popen(
            [sys.executable, "-c", _COMMAND],
            env=self._environment,
            cwd=self._root,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            bufsize=0,
            start_new_session=True,
        )
        self._line(None)

    def start(self, *words: str) -> float:
        """Starts a command line; when it began, s."""
        if (self._under_way and self.finish(0.5) is None) or self._process.poll() is not None:
            self.close()
            self._start()
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(words).encode() + b"\n")
        self._under_way = True
        return float(self._line(None) or "nan")

    def finish(self, seconds: float = 5.0) -> tuple[int, str] | None:
        """Exit code and last words of the command that was started last; None if it has not ended in some seconds."""
        line = self._line(seconds)
        if line is None:
            return None
        self._under_way = False
        code, said = json.loads(line or '[-1, ""]')
        return code, said

    def close(self) -> None:
        """Ends it."""
        self._process.kill()
        self._process.wait()

    def _line(self, seconds: float | None) -> str | None:
        """The next line of the process, "" if it has ended; None if none comes in some seconds."""
        assert self._process.stdout is not None
        while b"\n" not in self._said:
            if not select.select([self._process.stdout], [], [], seconds)[0]:
                return None
            more = os.read(self._process.stdout.fileno(), 4096)
            if not more:
                return ""
            self._said += more
        line, _, self._said = self._said.partition(b"\n")
        return line.decode()


def main() -> None:
    """Runs command lines until standard input ends."""
    from motiondeck.cli import main as cli

    def run(words: list[str]) -> tuple[int, str]:
        sys.argv, said, code = ["motiondeck", *words], io.StringIO(), 0
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            try:
                cli.main()
            except SystemExit as end:
                code = end.code if isinstance(end.code, int) else int(end.code is not None)
            except Exception as error:
                code, said = 1, io.StringIO(repr(error))
        return code, said.getvalue()[-300:]

    interrupt = signal.getsignal(signal.SIGINT)
    run(["send", "help"])
    run(["conduct", "/"])  # fails, and has imported what a show needs
    print("ready", flush=True)
    for line in sys.stdin:
        print(time.monotonic(), flush=True)
        print(json.dumps(run(json.loads(line))), flush=True)
        signal.signal(signal.SIGINT, interrupt)
