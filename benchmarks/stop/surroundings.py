"""What stands around a deck in the fault matrix: a network that loses datagrams, idle clients, a full disk, a clock."""

from __future__ import annotations

import contextlib
import random
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path


class LossyNetwork:
    """Relays datagrams between clients at `port` and a deck, and loses some of them, both ways."""

    def __init__(self, deck_port: int, loss: float, seed: int = 0) -> None:
        self._rng, self._loss = random.Random(seed), loss
        self._front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._front.bind(("127.0.0.1", 0))
        self.port = int(self._front.getsockname()[1])
        self._deck = ("127.0.0.1", deck_port)
        self._backs: dict[tuple[str, int], socket.socket] = {}
        threading.Thread(target=self._forward, daemon=True).start()

    def _forward(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                data, client = self._front.recvfrom(65536)
                if client not in self._backs:
                    self._backs[client] = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                    self._backs[client].connect(self._deck)
                    threading.Thread(target=self._back, args=(client,), daemon=True).start()
                if self._rng.random() >= self._loss:
                    with contextlib.suppress(ConnectionError):
                        self._backs[client].send(data)

    def _back(self, client: tuple[str, int]) -> None:
        back = self._backs[client]
        while True:
            try:
                data = back.recv(65536)
                if self._rng.random() >= self._loss:
                    self._front.sendto(data, client)
            except ConnectionError:
                continue  # nothing listens at the deck's port at the moment
            except OSError:
                return

    def close(self) -> None:
        """Ends it."""
        for each in (self._front, *self._backs.values()):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()


@contextlib.contextmanager
def idle_clients(folder: Path, count: int) -> Iterator[int]:
    """Connects so many clients that say nothing to each socket in a folder; how many were connected at first."""
    opened: list[socket.socket] = []
    try:
        for path in folder.iterdir():
            if not path.is_socket():
                continue
            for _ in range(count):
                client = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                client.setblocking(False)
                opened.append(client)
                for _ in range(20):
                    try:
                        client.connect(str(path))
                        break
                    except BlockingIOError:  # the deck has not accepted the ones before
                        time.sleep(0.005)
                    except OSError:
                        break
        yield len(opened)
    finally:
        for client in opened:
            client.close()


@contextlib.contextmanager
def small_disk(folder: Path) -> Iterator[Path]:
    """A file on a disk that is full at once: a tmpfs of 64 kB, or /dev/full where none may be mounted."""
    folder.mkdir(exist_ok=True)
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "motiondeck-stop", folder], capture_output=True)
    try:
        yield folder / "run.rec" if mounted.returncode == 0 else Path("/dev/full")
    finally:
        if mounted.returncode == 0:
            subprocess.run(["umount", "-l", folder], check=True)


def step_clock(seconds: float) -> bool:
    """Steps the clock of the machine (CLOCK_REALTIME); False where that is not permitted."""
    try:
        now = time.clock_gettime_ns(time.CLOCK_REALTIME)
        time.clock_settime_ns(time.CLOCK_REALTIME, now + round(1e9 * seconds))
    except OSError:
        return False
    return True
