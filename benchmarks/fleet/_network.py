"""Network namespaces, connected by a network with delay and loss: a router of ours, packet by packet.

Each namespace has a TUN device; the router reads its packets, drops some, and writes the others after the delay to the
device of whom they are for. `tc netem` would do the same, but is not part of every kernel. Needs root and /dev/net/tun.
"""

from __future__ import annotations

import fcntl
import heapq
import itertools
import os
import random
import select
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from motiondeck_base.errors import MotiondeckError

_SET_DEVICE, _TUN, _NO_HEADER = 0x400454CA, 0x0001, 0x1000
_PREFIX = "mdfleet"


NET = 77
"""The number of a network, of its namespaces and addresses; several can be there at once."""


def namespace(number: int, net: int = NET) -> str:
    """The name of a namespace."""
    return f"{_PREFIX}{net}-{number}"


def address(number: int, net: int = NET) -> str:
    """The address in a namespace."""
    return f"10.{net}.0.{number + 1}"


class Network:
    """A running network."""

    def __init__(self, router: subprocess.Popen[bytes]) -> None:
        self._router = router

    def cut(self, number: int) -> None:
        """Drops all packets to and from a namespace."""
        self._say(f"cut {number}")

    def heal(self, number: int) -> None:
        """Ends that."""
        self._say(f"heal {number}")

    def part(self, one: int, other: int) -> None:
        """Drops all packets between two namespaces."""
        self._say(f"part {one} {other}")

    def join(self, one: int, other: int) -> None:
        """Ends that."""
        self._say(f"join {one} {other}")

    def delay(self, delay_ms: float) -> None:
        """Delays packets by this from now on, one way."""
        self._say(f"delay {1e-3 * delay_ms}")

    def loss(self, share: float) -> None:
        """Loses this share of the packets from now on."""
        self._say(f"loss {share}")

    def _say(self, line: str) -> None:
        assert self._router.stdin is not None
        self._router.stdin.write(line.encode() + b"\n")
        self._router.stdin.flush()


@contextmanager
def network(members: int, delay_ms: float, loss: float, net: int = NET) -> Iterator[Network]:
    """So many connected namespaces while the block runs.

    Raises:
        MotiondeckError: if that is not permitted here.
    """
    if os.geteuid() != 0 or not os.path.exists("/dev/net/tun"):  # noqa: PTH110
        raise MotiondeckError("network namespaces need root and /dev/net/tun")
    command = [
        sys.executable,
        "-c",
        "from benchmarks.fleet._network import main; main()",
        str(members),
        str(delay_ms),
        str(loss),
        str(net),
    ]
    router = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert router.stdout is not None
    assert router.stdin is not None
    try:
        if router.stdout.readline() != b"ready\n":
            raise MotiondeckError("the network namespaces could not be made: see above")
        yield Network(router)
    finally:
        router.stdin.close()
        router.wait(10)


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True)


def _open_device(number: int, net: int) -> int:
    """A TUN device in a namespace of its own."""
    device = inside = namespace(number, net)
    file = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(file, _SET_DEVICE, struct.pack("16sH", device.encode(), _TUN | _NO_HEADER))
    _ip("netns", "add", inside)
    _ip("link", "set", device, "netns", inside)
    _ip("-n", inside, "link", "set", "lo", "up")
    _ip("-n", inside, "addr", "add", f"{address(number, net)}/24", "dev", device)
    _ip("-n", inside, "link", "set", device, "up")
    return file


def _route(devices: list[int], delay: float, loss: float) -> None:
    """Passes packets on until standard input closes."""
    chance, order = random.Random(1), itertools.count()
    waiting: list[tuple[float, int, int, bytes]] = []
    cut: set[int] = set()
    parted: set[frozenset[int]] = set()
    number_of = {file: number for number, file in enumerate(devices)}
    poll = select.epoll()
    for file in (*devices, 0):
        poll.register(file, select.EPOLLIN)
    while True:
        wait = max(waiting[0][0] - time.monotonic(), 0.0) if waiting else 1.0
        for file, _ in poll.poll(wait):
            if file == 0:
                data = os.read(0, 4096)
                if not data:
                    return
                for line in data.decode().splitlines():
                    match line.split():
                        case ["cut", number]:
                            cut.add(int(number))
                        case ["heal", number]:
                            cut.discard(int(number))
                        case ["part", one, other]:
                            parted.add(frozenset({int(one), int(other)}))
                        case ["join", one, other]:
                            parted.discard(frozenset({int(one), int(other)}))
                        case ["delay", seconds]:
                            delay = float(seconds)
                        case ["loss", share]:
                            loss = float(share)
                continue
            with suppress(BlockingIOError):
                while packet := os.read(file, 65536):
                    to = packet[19] - 1
                    if packet[0] >> 4 != 4 or not 0 <= to < len(devices) or {number_of[file], to} & cut:
                        continue
                    if {number_of[file], to} not in parted and chance.random() >= loss:
                        heapq.heappush(waiting, (time.monotonic() + delay, next(order), to, packet))
        now = time.monotonic()
        while waiting and waiting[0][0] <= now:
            _, _, to, packet = heapq.heappop(waiting)
            if to not in cut:
                with suppress(OSError):
                    os.write(devices[to], packet)


def main() -> None:
    """The router's process: how many devices, delay in ms, loss, the network's number; `Network` commands it."""
    count, delay_ms, loss, net = int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])
    for number in range(count):
        subprocess.run(["ip", "netns", "del", namespace(number, net)], stderr=subprocess.DEVNULL)
    try:
        devices = [_open_device(number, net) for number in range(count)]
        print("ready", flush=True)
        _route(devices, 1e-3 * delay_ms, loss)
    finally:
        for number in range(count):
            subprocess.run(["ip", "netns", "del", namespace(number, net)], stderr=subprocess.DEVNULL)
