"""What the machine itself withholds: on each core a loop that does nothing but note when it is woken late.

It asks to be woken every millisecond, at a higher real-time priority than any deck. When even it is late, no program on
that core could have acted in time: the host of a virtual machine had the core, or the kernel kept it.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.loop.permissions import FIFO_PRIORITY

EVERY, NOTED = 1e-3, 1e-3
"""It is woken so often, and notes what is later than that, s."""


@contextmanager
def idle_watch(folder: Path) -> Iterator[None]:
    """Watches all cores while the block runs; `stalls` reads what was noted in the folder."""
    watches = [
        subprocess.Popen(
            [sys.executable, "-c", "from benchmarks.fleet._idle_watch import main; main()", str(core), str(folder)]
        )
        for core in sorted(os.sched_getaffinity(0))
    ]
    try:
        yield
    finally:
        for watch in watches:
            watch.terminate()
            watch.wait()


def stalls(folder: Path) -> NDArray[np.float64]:
    """When the stalls of all cores ended and how long they were, s, shape (N, 2)."""
    lines = [line.split() for file in folder.glob("idle-*") for line in file.read_text().splitlines()]
    return np.array(lines, dtype=float).reshape(-1, 2)


def main() -> None:
    """Watches one core until it is told to end: the core, the folder."""
    core, folder = int(sys.argv[1]), Path(sys.argv[2])
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    os.sched_setaffinity(0, {core})
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(FIFO_PRIORITY + 10))
    with (folder / f"idle-{core}").open("w", buffering=1) as file:
        due = time.monotonic()
        while True:
            due += EVERY
            time.sleep(max(due - time.monotonic(), 0.0))
            now = time.monotonic()
            if now - due > NOTED:
                file.write(f"{now:.6f} {now - due:.6f}\n")
                due = now
