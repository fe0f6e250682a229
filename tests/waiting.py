"""What tests of several processes share: free ports, and waiting for something that happens elsewhere."""

import itertools
import os
import socket
import time
from contextlib import suppress
from pathlib import Path

PATIENCE = 30.0  # s that is waited for what another thread or process does at once, where it gets a core

# Below those that the system gives to connections, which would take one before its test does; each process begins
# elsewhere.
_PORTS = itertools.cycle([10_000 + (500 * os.getpid() + number) % 20_000 for number in range(20_000)])


def free_port():
    """A port of 127.0.0.1 that nobody uses, for TCP and UDP."""
    return next(filter(_is_free, _PORTS))


def free_ports(count):
    """Some of them, all different."""
    return [free_port() for _ in range(count)]


def _is_free(port):
    try:
        for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM):
            with socket.socket(socket.AF_INET, kind) as probe:
                probe.bind(("0.0.0.0", port))
    except OSError:
        return False
    return True


def until(condition, what, seconds=60.0):
    """What the condition gives when it holds; a browser without a graphics card on a busy machine takes its time."""
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        time.sleep(0.02)
    return found


def runs(process):
    """Whether a process is there and has not ended; one that nobody has waited for yet is a zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def tried(act):
    """What an act in real time gives, by its fifth attempt at the latest: a busy machine spoils some of them."""
    for _ in range(4):
        with suppress(AssertionError):
            return act()
    return act()


def soon(act):
    """What an act gives as soon as it does not fail: what it looks at comes in parts, and each takes its time."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        with suppress(AssertionError):
            return act()
        time.sleep(0.1)
    return act()


def quick(act, within):
    """Acts until that took less than `within` s: a busy machine makes some attempts slow, a wait in the product all."""

    def acted():
        began = time.monotonic()
        act()
        return time.monotonic() - began < within

    until(acted, f"an attempt of less than {within} s")
