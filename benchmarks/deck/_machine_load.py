"""Load beside a benchmark: a process that keeps a core busy, and the time that a virtual machine's host takes away."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def hog(wanted: bool, core: int | None) -> Iterator[None]:
    """A process that keeps a core busy; not the loop's own, if that is known."""
    if not wanted:
        yield
        return
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    others = sorted(os.sched_getaffinity(0) - {core})
    if others:
        os.sched_setaffinity(busy.pid, {others[-1]})
    try:
        yield
    finally:
        busy.kill()
        busy.wait()


def stolen_ms() -> float:
    """The time that the host has taken from this machine since it started, all cores together; 0 where none tells."""
    try:
        jiffies = int(Path("/proc/stat").read_text().split(maxsplit=9)[8])
    except (OSError, ValueError, IndexError):
        return 0.0
    return 1e3 * jiffies / os.sysconf("SC_CLK_TCK")
