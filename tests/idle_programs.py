"""Programs that connect to a socket of a deck and then say nothing."""

from __future__ import annotations

import resource
import socket
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path


def connected(path: Path) -> socket.socket:
    """A connection that does not block."""
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    connection.connect(str(path))
    connection.setblocking(False)
    return connection


@contextmanager
def idle_programs(path: Path, count: int) -> Iterator[None]:
    """So many connections, or as many as this process may have open files."""
    before = soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = 1 << 16 if hard == resource.RLIM_INFINITY else hard
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, most), hard))
    try:
        with ExitStack() as opened:
            for _ in range(min(count, (most - 200) // 2)):  # their other ends may be in this process
                opened.enter_context(closing(connected(path)))
            yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
