"""What tests of several processes share: free ports, and waiting for something that happens elsewhere."""

import socket
import time
from contextlib import ExitStack


def free_port():
    """A port of 127.0.0.1 that nobody listens on."""
    return free_ports(1)[0]


def free_ports(count):
    """Some of them, all different."""
    with ExitStack() as opened:
        probes = [opened.enter_context(socket.socket()) for _ in range(count)]
        for probe in probes:
            probe.bind(("127.0.0.1", 0))
        return [probe.getsockname()[1] for probe in probes]


def until(condition, what, seconds=60.0):
    """What the condition gives when it holds; a browser without a graphics card on a busy machine takes its time."""
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        time.sleep(0.02)
    return found
